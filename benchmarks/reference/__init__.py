# SPDX-License-Identifier: Apache-2.0
"""Reference solutions that every error is measured against, and how far they can be trusted.

Dynamics in extended precision and an integrator of any order, both written apart from what is
measured, and the controlled motion that all simulators are given.
"""
