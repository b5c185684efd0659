# SPDX-License-Identifier: Apache-2.0
"""Iterations of trajectory optimization, beside Crocoddyl's.

Crocoddyl needs a Pinocchio of its own: it runs in another Python, which takes its turn in each
round. Knows the optimizer and clocks, and writes a table.
"""
