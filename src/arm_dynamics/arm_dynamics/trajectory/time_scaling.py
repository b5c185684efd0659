# SPDX-License-Identifier: Apache-2.0
"""Uniform time scaling of a motion, such that speeds and torques are within limits.

Slower by s, velocities shrink by 1/s and accelerations by 1/s², so with x = 1/s a torque along the
path is G + F_dry + F_viscous x + (M a + C v) x², known for every speed from one evaluation
(Hollerbach, "Dynamic scaling of manipulator trajectories", ASME J. Dyn. Sys. Meas. Control 106,
1984).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive_limits
from arm_dynamics.dynamics.dynamics import Dynamics, Term
from arm_dynamics.exceptions import Unreachable


def torque_limits(dynamics: Dynamics, given: ArrayLike | None) -> Array:
    """Torque limits, from one positive number or shape (n,), else the model's; shape (n,)."""
    if given is None:
        return dynamics.model.effort_limit
    return positive_limits("limit", given, dynamics.n)


def torque_stretch(dynamics: Dynamics, q: Array, v: Array, a: Array, limit: Array) -> float:
    """Time-scaling factor, at least one, that keeps torques within limits.

    Args:
        dynamics: The model.
        q: Positions along the motion in [rad] or [m], shape (k, n).
        v: Velocities, likewise.
        a: Accelerations, likewise.
        limit: Largest torques in [N m] or [N], inf for none, shape (n,).

    Raises:
        Unreachable: If gravity, springs and dry friction alone exceed a limit.
    """
    k, rigid = len(q), Term.INERTIA | Term.CORIOLIS | Term.GRAVITY
    still = np.zeros_like(q)
    tau = dynamics.inverse(np.vstack([q, q]), np.vstack([v, still]), np.vstack([a, still]), rigid)
    weight, friction = tau[k:], dynamics.steady_friction
    elastic, sprung = dynamics.spring(q), dynamics.spring(q, v)
    standing = weight + elastic
    if friction.has_dry:
        standing = standing + friction.dry(v, np.sign(v), q, tau[:k] + sprung)
    moving = friction.joints.smooth(v) + sprung - elastic
    _check_standing(dynamics, standing, limit)
    x = np.ones_like(q)
    for sign in (1.0, -1.0):
        parts = sign * (tau[:k] - weight), sign * moving, sign * standing - limit
        x = np.minimum(x, _first_crossing(*parts))
    return 1.0 / float(x.min())


def _first_crossing(two: Array, one: Array, zero: Array) -> Array:
    """Least x in (0, 1] where two x² + one x + zero rises through zero, else one; zero < 0."""
    finite = np.isfinite(zero)
    c = np.where(finite, zero, -1.0)
    root = one * one - 4.0 * two * c
    # With c < 0 this form, 2c / (-b ∓ √…), has no cancellation and gives the positive root.
    below = one + np.sqrt(np.maximum(root, 0.0))
    x = np.divide(-2.0 * c, below, out=np.full_like(c, np.inf), where=below > 0.0)
    return np.where(finite & (root >= 0.0) & (x > 0.0), np.minimum(x, 1.0), 1.0)


def _check_standing(dynamics: Dynamics, standing: Array, limit: Array) -> None:
    excess = abs(standing) - limit
    i, joint = np.unravel_index(np.argmax(excess), excess.shape)
    if excess[i, joint] >= 0.0:
        parts = "weight, springs" if dynamics.model.springs else "weight"
        raise Unreachable(
            f"{parts} and dry friction of joint '{dynamics.joint_names[joint]}' take "
            f"{abs(standing[i, joint]):.4g} along the motion at any pace; its limit is "
            f"{limit[joint]:.4g}",
            float(excess[i, joint]),
        )
