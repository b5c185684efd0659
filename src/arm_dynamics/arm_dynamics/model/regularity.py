# SPDX-License-Identifier: Apache-2.0
"""Regularity of mass matrices: every motion of the joints must move mass."""

from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ModelError

_ROUNDING = 1e-28  # fraction of the largest inertia that is rounding of zero
_LEAST_SHARE = 0.1  # smallest rate, relative to the largest, of a joint named in a massless motion

MASSLESS = (
    "no link has mass or inertia, so there is no gravity and no inertia; give the links "
    "<inertial> in the URDF, or the scene links, payloads, or joints with an armature"
)


def largest_condition(n: int) -> float:
    """Condition number above which a matrix of n rows is singular to rounding, 1 / (n ε).

    It applies to M scaled to unit diagonal, which makes it independent of units and of the ratio
    of a heavy base to a light finger, and is within a factor of n of the least that any scaling
    gives (van der Sluis, Numerische Mathematik 14, 1969). Published robots stay below 2e6.
    """
    return 1.0 / (n * float(np.finfo(float).eps))


def some_positions(n: int) -> Array:
    """Deterministic sample positions within one revolution or 3 m, shape (5, n).

    Joint limits are ignored: many descriptions state 1e9 m for "no limit", where M is meaningless.
    """
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (5, n))


def check_regular(M: Array, joint_names: Sequence[str]) -> None:
    """Reject mass matrices that are singular to rounding.

    Args:
        M: In [kg m²] or [kg], shape (k, n, n).
        joint_names: Names of the joints, in order.

    Raises:
        ModelError: If one is singular; names the joints that move no mass, and the condition
            number.
    """
    inertia = np.diagonal(M, axis1=-2, axis2=-1)
    is_zero = inertia <= _ROUNDING * inertia.max(axis=-1, keepdims=True)
    scale = 1.0 / np.sqrt(np.where(is_zero, 1.0, inertia))
    values, motions = np.linalg.eigh(scale[:, :, None] * M * scale[:, None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.where(is_zero.any(-1), np.inf, values[:, -1] / np.maximum(values[:, 0], 0))
    index = int(np.argmax(condition))
    limit = largest_condition(len(joint_names))
    if condition[index] <= limit:
        return
    share = abs(motions[index, :, 0])
    massless = is_zero[index]
    involved = massless if massless.any() else share > _LEAST_SHARE * share.max()
    listed = ", ".join(f"'{name}'" for name, yes in zip(joint_names, involved, strict=True) if yes)
    alone = f"joint {listed} moves" if involved.sum() == 1 else f"joints {listed} move"
    subject = alone if massless.any() else f"joints {listed} can move together so that they move"
    raise ModelError(
        f"{subject} no mass, so no torque determines the acceleration: the condition number of "
        f"the mass matrix is {condition[index]:.3g}, allowed: up to {limit:.1e}; give a "
        "link inertia, a joint an armature, or lock one"
    )
