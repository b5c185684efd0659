# SPDX-License-Identifier: Apache-2.0
"""What a task space answers with; all arrays are read-only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from arm_dynamics.arrays import Array


@dataclass(frozen=True)
class Pose:
    """Placement of a frame in the world.

    Attributes:
        position: In [m], shape (3,) or (k, 3).
        rotation: Rotation matrix, its columns the frame's axes, shape (3, 3) or (k, 3, 3).
    """

    position: Array
    rotation: Array


@dataclass(frozen=True)
class TaskTerms:
    """The arm at one state, in the task's m axes; a batch has k in front of every shape.

    Attributes:
        position: Position of the frame in the world in [m], shape (3,).
        rotation: Rotation of the frame in the world, shape (3, 3).
        jacobian: J, with ẋ = J q̇, shape (m, n).
        velocity: ẋ = J q̇ in [m/s] and [rad/s], shape (m,).
        bias: J̇ q̇, the acceleration that is there without joint acceleration, shape (m,).
        inertia: Λ = (J M⁻¹ Jᵀ)⁻¹ in [kg], [kg m], [kg m²], shape (m, m).
        coriolis: µ = Λ (J M⁻¹ C q̇ - J̇ q̇) in [N] and [N m], shape (m,).
        gravity: p = Λ J M⁻¹ G in [N] and [N m], shape (m,).
        inverse: J̄ = M⁻¹ Jᵀ Λ, the dynamically consistent inverse of J, shape (n, m).
        null_space: N = 1 - J̄ J: velocities N z do not move the frame, torques Nᵀ z do not
            accelerate it, shape (n, n).
        manipulability: √det(J Jᵀ), zero at a singularity.
        condition: Ratio of the singular values of J, inf at a singularity.
        damped: Whether the state is so near a singularity that Λ, µ, p, J̄ and N were damped.
    """

    position: Array
    rotation: Array
    jacobian: Array
    velocity: Array
    bias: Array
    inertia: Array
    coriolis: Array
    gravity: Array
    inverse: Array
    null_space: Array
    manipulability: Any
    condition: Any
    damped: Any


@dataclass(frozen=True)
class EffectiveMass:
    """Mass felt along a direction.

    Attributes:
        mass: In [kg] along an axis or [kg m²] about one; a float, or shape (k,).
        damped: Whether the direction is (nearly) immobile and its infinite mass was bounded.
    """

    mass: Any
    damped: Any


@dataclass(frozen=True)
class MassEllipsoid:
    """Principal effective masses.

    Attributes:
        masses: From light to heavy in [kg] or [kg m²], shape (m,) or (k, m).
        axes: Their directions as columns, shape (m, m) or (k, m, m).
        damped: Whether a mass, truly infinite, was bounded.
    """

    masses: Array
    axes: Array
    damped: Any
