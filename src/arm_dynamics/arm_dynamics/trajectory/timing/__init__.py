# SPDX-License-Identifier: Apache-2.0
"""When the points of a path are passed: timing laws, and how much slower a motion must be.

Depends on the dynamics of the arm and its limits.
"""
