# SPDX-License-Identifier: Apache-2.0
"""Whether mass matrices can be solved with: every motion of the joints must move mass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ModelError

_NOTHING = 1e-28  # part of the largest inertia that is the rounding of none
_INVOLVED = 0.1  # part of the largest joint rate of a motion without mass, from which one is named


def largest_condition(n: int) -> float:
    """Condition number from which on a matrix of n rows is singular to rounding, 1 / (n ε).

    It is that of M in units in which its diagonal is one: so it is the same in [m] and [mm], and
    for a heavy base with a light finger, and but for a factor of n the least that any units give
    (van der Sluis, Numerische Mathematik 14, 1969). Published robots stay below 2e6.
    """
    return 1.0 / (n * float(np.finfo(float).eps))


def some_positions(n: int) -> Array:
    """Positions within a turn or 3 m to look at, always the same ones, shape (5, n).

    Limits have no say: many a description means "none" by a limit of 1e9 m, where M is no arm's.
    """
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (5, n))


def check_regular(M: Array, joint_names: Sequence[str]) -> None:
    """Refuse mass matrices that are singular to rounding.

    Args:
        M: In [kg m²] or [kg], shape (k, n, n).
        joint_names: Names of the joints, in order.

    Raises:
        ModelError: Naming the joints that move without moving mass, and the condition number.
    """
    inertia = np.diagonal(M, axis1=-2, axis2=-1)
    nothing = inertia <= _NOTHING * inertia.max(axis=-1, keepdims=True)
    scale = 1.0 / np.sqrt(np.where(nothing, 1.0, inertia))
    values, motions = np.linalg.eigh(scale[:, :, None] * M * scale[:, None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.where(nothing.any(-1), np.inf, values[:, -1] / np.maximum(values[:, 0], 0))
    worst = int(np.argmax(condition))
    most = largest_condition(len(joint_names))
    if condition[worst] <= most:
        return
    share = abs(motions[worst, :, 0])
    dead = nothing[worst]
    involved = dead if dead.any() else share > _INVOLVED * share.max()
    listed = ", ".join(f"'{name}'" for name, yes in zip(joint_names, involved, strict=True) if yes)
    alone = f"joint {listed} moves" if involved.sum() == 1 else f"joints {listed} move"
    who = alone if dead.any() else f"joints {listed} can move together so that they move"
    raise ModelError(
        f"{who} no mass, so no torque determines the acceleration: the condition number of the "
        f"mass matrix is {condition[worst]:.3g}, up to {most:.1e} is allowed; give a "
        "link inertia, a joint an armature, or lock one"
    )
