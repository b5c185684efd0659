# SPDX-License-Identifier: Apache-2.0
"""Run time against error: this suite and the simulators people could pick instead, in one run.

``python -m benchmarks --help`` from the project root, or ``./arm bench``.
"""
