# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a tick and gradients of motions: time and error, beside what others offer.

Ours beside Pinocchio's ``computeABADerivatives`` and MuJoCo's finite differences. Knows peers and
clocks, and writes a table.
"""
