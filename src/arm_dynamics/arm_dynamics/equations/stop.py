# SPDX-License-Identifier: Apache-2.0
"""Compliant end stops: a spring and a damper that a joint leans on and that never pull.

The stop loses the joint when both together would pull, which with damping is before the spring is
relaxed (Brogliato, Nonsmooth Mechanics, 2016, section 2.1).
"""

from __future__ import annotations

import casadi as ca

from arm_dynamics.arrays import Array


def pressures(q: ca.SX, v: ca.SX, place: Array, stiffness: Array, damping: Array) -> ca.SX:
    """What stops would push back with, were a joint in touch with them.

    Args:
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities in [rad/s] or [m/s], shape (n,).
        place: Of the lower and the upper stops in [rad] or [m], shape (2, n).
        stiffness: In [N m/rad] or [N/m], zero for stops that are not compliant, shape (2, n).
        damping: In [N m s/rad] or [N s/m], shape (2, n).

    Returns:
        Torques in [N m] or [N] away from the lower and from the upper stops, positive where they
        push, shape (2 n,); zero for stops that are not compliant.
    """
    found = []
    for side, sign in ((0, -1.0), (1, 1.0)):
        for i in range(q.shape[0]):
            k, c = stiffness[side, i], damping[side, i]
            push = k * (sign * (q[i] - place[side, i])) + c * (sign * v[i]) if k else ca.SX(0)
            found.append(push)
    return ca.vertcat(*found)
