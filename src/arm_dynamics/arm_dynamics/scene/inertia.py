# SPDX-License-Identifier: Apache-2.0
"""Mass and rotational inertia of a rigid body, and their physical consistency.

About the centre of mass, I = ∫ (rᵀr E - r rᵀ) dm with dm ≥ 0. Hence no principal moment is
negative, and none is larger than the sum of the other two (triangle inequality: Wensing, Kim,
Slotine, IEEE Robotics and Automation Letters 3(1), 2018).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationInfo, field_validator

from arm_dynamics.arrays import Array
from arm_dynamics.scene.types import Inertia6, NonNegative, Part, Positive, Vector3

# Moments below this fraction of the largest one are treated as zero: published values are often
# the result of computations with rounding errors.
ROUNDING = 1e-10
# Radius of gyration in [m] and moment in [kg m²] below which moments are rounding errors. A body
# of 1e-9 kg and 1 mm has 1e-15 kg m².
POINT_RADIUS, POINT_MOMENT = 1e-8, 1e-25
# Allowed relative excess of the largest moment over the sum of the others: published values have
# two or three digits, and for a thin plate both are equal.
TRIANGLE_TOLERANCE = 1e-2


def inertia_matrix(six: Inertia6 | ArrayLike) -> Array:
    """Symmetric tensors, shape (…, 3, 3), from ixx, ixy, ixz, iyy, iyz, izz in [kg m²]."""
    return np.asarray(six, dtype=float)[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]


def six_of(tensor: Array) -> Array:
    """ixx, ixy, ixz, iyy, iyz, izz of symmetric tensors of shape (…, 3, 3), shape (…, 6)."""
    return tensor[..., [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def moments(six: Inertia6 | ArrayLike) -> Array:
    """Principal moments in [kg m²], the smallest first, shape (…, 3)."""
    return np.asarray(np.linalg.eigvalsh(inertia_matrix(six)))


def gyration(mass: float, six: Inertia6 | ArrayLike) -> float:
    """Largest radius of gyration in [m] of a body of a mass in [kg], more than zero."""
    return math.sqrt(max(float(moments(six)[-1]), 0.0) / mass)


def moment_tolerance(mass: Array | float) -> Array:
    """Moments in [kg m²] up to which a body of a mass in [kg] is a point mass, shape (…)."""
    return np.asarray(mass, dtype=float) * POINT_RADIUS**2 + POINT_MOMENT


def possible(mass: ArrayLike, six: Inertia6 | ArrayLike) -> NDArray[np.bool_]:
    """Whether masses in [kg] and tensors are physically consistent, shape (…)."""
    return np.asarray(_fault(np.asarray(mass, dtype=float), moments(six)) == 0)


def fault(mass: float, six: Inertia6 | ArrayLike) -> str | None:
    """Why a mass in [kg] and a tensor are not those of a rigid body; None if they are."""
    principal = moments(six)
    listed = ", ".join(f"{moment:.6g}" for moment in principal)
    return [
        None,
        f"mass = {mass:g} kg: at least zero is expected",
        f"the tensor must not be negative in any direction; principal moments {listed} kg m²",
        f"mass = 0, but inertia of {principal[2]:.6g} kg m²: more than zero is expected",
        f"no body has principal moments {listed} kg m²: none may be larger than the sum of the "
        f"other two (by {TRIANGLE_TOLERANCE:.0%} at most, for rounding)",
    ][int(_fault(np.asarray(mass, dtype=float), principal))]


def _fault(mass: Array, principal: Array) -> NDArray[np.int_]:
    """Number of the first condition that is violated, 0 for none, shape (…)."""
    small, middle, large = np.moveaxis(principal, -1, 0)
    violated = [
        ~(mass >= 0.0),
        small < -np.maximum(ROUNDING * large, moment_tolerance(mass)),
        (mass == 0.0) & (large > moment_tolerance(mass)),
        large - middle - small > np.maximum(TRIANGLE_TOLERANCE * large, moment_tolerance(mass)),
    ]
    return np.select(violated, [1, 2, 3, 4], 0)


class Body(Part):
    """A rigid body in a frame.

    Attributes:
        mass: Mass in [kg].
        com: Centre of mass in the frame, in [m].
        inertia: ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, along the axes of the
            frame, in [kg m²]. No principal moment may be negative, or larger than the sum of the
            other two.
    """

    mass: NonNegative
    com: Vector3 = (0.0, 0.0, 0.0)
    inertia: Inertia6 = (0.0,) * 6

    @field_validator("inertia")
    @classmethod
    def _check_body(cls, value: Inertia6, info: ValidationInfo) -> Inertia6:
        mass = info.data.get("mass")  # absent if it is invalid itself
        if mass is not None and (defect := fault(mass, value)):
            raise ValueError(defect)
        return value


class LinkBody(Body):
    """The inertia of a link in place of the URDF's ``<inertial>``, all of which it replaces.

    The frame is that of the link. Bodies that fixed or locked joints connect to it keep theirs.
    """

    mass: Positive
