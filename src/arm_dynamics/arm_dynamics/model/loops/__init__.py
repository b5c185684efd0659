# SPDX-License-Identifier: Apache-2.0
"""Kinematic loops: independent rows of their constraints, and closed states."""
