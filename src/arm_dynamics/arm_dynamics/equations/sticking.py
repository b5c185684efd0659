# SPDX-License-Identifier: Apache-2.0
"""Forward dynamics of an arm some of whose joints stick.

A joint at rest under dry friction is not a stiff spring but a constraint, q̈ = 0, with the
friction as its reaction (Karnopp, "Computer simulation of stick-slip friction in mechanical
dynamic systems", J. Dyn. Sys. Meas. Control 107, 1985; Glocker, Set-Valued Force Laws, 2001).
Which joints stick is an input, so that the expression has no branches.
"""

from __future__ import annotations

import casadi as ca

from arm_dynamics.equations.rigid_body import solve


def forward(M: ca.SX, free: ca.SX, sliding: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Solve M q̈ + R = free, with q̈ = 0 where a joint sticks and R = 0 where it slides.

    Args:
        M: Joint-space inertia in [kg m²] or [kg], shape (n, n).
        free: Torques that act: command less Coriolis, gravity and the friction of sliding joints,
            shape (n,).
        sliding: 1 for a joint that slides, 0 for one that sticks, shape (n,).

    Returns:
        Accelerations, exactly zero where a joint sticks, and reactions R, both of shape (n,).
    """
    n = M.shape[0]
    S = ca.diag(sliding)
    a = solve(S @ M @ S + ca.diag(1 - sliding), S @ free)
    return a, (ca.SX.eye(n) - S) @ (free - M @ a)
