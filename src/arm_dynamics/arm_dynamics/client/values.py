# SPDX-License-Identifier: Apache-2.0
"""What a client hands out, and how numbers become fields of a request and back."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, Refused, Unreachable


@dataclass(frozen=True)
class ModelFacts:
    """What a dynamics node knows about its arm; vectors have shape (n,).

    Attributes:
        joint_names: The model's order.
        joint_types: ``revolute``, ``continuous`` or ``prismatic``.
        position_lower: In [rad] or [m]; -inf for none.
        position_upper: In [rad] or [m]; inf for none.
        velocity_limits: In [rad/s] or [m/s]; inf for none.
        effort_limits: In [N m] or [N]; inf for none.
        frame_names: Frames of the arm.
        total_mass: In [kg].
        gravity: In the world frame in [m/s²], shape (3,).
        summary: A description in one line.
    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    position_lower: Array
    position_upper: Array
    velocity_limits: Array
    effort_limits: Array
    frame_names: tuple[str, ...]
    total_mass: float
    gravity: Array
    summary: str


@dataclass(frozen=True)
class Terms:
    """The parts of the equation of motion; a batch has k in front of every shape.

    Attributes:
        joint_names: Order of the vectors.
        mass_matrix: M(q), shape (n, n).
        coriolis_matrix: C(q, v), shape (n, n).
        gravity: G(q) in [N m] or [N], shape (n,).
        friction: F(v) in [N m] or [N], shape (n,).
        kinetic_energy: In [J], shape ().
        potential_energy: In [J], shape ().
    """

    joint_names: tuple[str, ...]
    mass_matrix: Array
    coriolis_matrix: Array
    gravity: Array
    friction: Array
    kinetic_energy: Array
    potential_energy: Array


@dataclass(frozen=True)
class ConstrainedMotion:
    """Motion under the scene's constraints; a batch has k in front of both shapes.

    Attributes:
        joint_names: Order of the accelerations.
        constraint_names: The constraint that each multiplier belongs to, m names.
        acceleration: In [rad/s²] or [m/s²], shape (n,).
        multipliers: λ, what the arm exerts against the constraints, in [N] or [N m], shape (m,):
            force and moment of a constraint's first frame upon its second, in axes of the second.
    """

    joint_names: tuple[str, ...]
    constraint_names: tuple[str, ...]
    acceleration: Array
    multipliers: Array


@dataclass(frozen=True)
class Postures:
    """Joint positions for poses; a batch has k in front of every shape.

    Attributes:
        joint_names: Order of the positions.
        q: Within limits, in [rad] or [m], shape (n,); the nearest found where a pose is not
            reached.
        reached: Whether the pose is reached to 1e-9 m and 1e-9 rad, shape ().
        distance: What is missing in [m], shape ().
        angle: What is missing in [rad], shape ().
    """

    joint_names: tuple[str, ...]
    q: Array
    reached: NDArray[np.bool_]
    distance: Array
    angle: Array


class NotReached(Refused, Unreachable):
    """A node searched for joint positions and did not reach every pose; the message is the node's.

    ``found`` holds what it found for each pose: the nearest posture where a pose is not reached.
    """

    def __init__(self, message: str, found: Postures) -> None:
        super().__init__(message, float(found.distance.max()))
        self.found = found


def motion(joint_names: Sequence[str], **given: ArrayLike | None) -> dict[str, Any]:
    """Fields of a request: the order of joints, and flat vectors; what is None is left out."""
    vectors = {name: flat(name, value) for name, value in given.items() if value is not None}
    return {"joint_names": words("joint_names", joint_names), **vectors}


def flat(name: str, value: ArrayLike) -> array[float]:
    """Any real numbers as a flat field; ``InvalidInput`` if they are none."""
    try:
        numbers = np.asarray(value)
    except ValueError:
        numbers = np.asarray(None)
    if numbers.dtype.kind not in "fiu":
        raise InvalidInput(f"{name} = {value!r}; expected real numbers of one shape")
    return array("d", np.ascontiguousarray(numbers, float).tobytes())


def whole(name: str, value: int, most: int) -> int:
    """A whole number that the message's field holds."""
    if not isinstance(value, int | np.integer) or not 0 <= value <= most:
        raise InvalidInput(f"{name} = {value!r}; expected a whole number from 0 to {most}")
    return int(value)


def words(name: str, value: str | Sequence[str]) -> list[str]:
    """Names for a field, one or several; ``InvalidInput`` if they are none."""
    listed = [value] if isinstance(value, str) or not isinstance(value, Iterable) else list(value)
    if not all(isinstance(word, str) for word in listed):
        raise InvalidInput(f"{name} = {value!r}; expected names")
    return listed


def rows(name: str, value: ArrayLike, size: int) -> tuple[int, ...]:
    """Shape of an argument of ``size`` numbers, or of ``size`` for each of k: (), or (k,)."""
    shape = np.shape(value)
    if len(shape) not in (1, 2) or shape[-1] != size:
        raise InvalidInput(f"{name} has shape {shape}; expected ({size},) or (k, {size})")
    return shape[:-1]


def points(answer: Any, q: ArrayLike) -> tuple[int, ...]:
    """Shape of the question: (n,) or (k, n)."""
    n = len(answer.joint_names)
    return (*rows("position", q, n), n)


def fixed(name: str, value: ArrayLike, size: int) -> Array:
    """Numbers for a field of ``size``; ``InvalidInput`` if they are more or fewer."""
    numbers = np.array(flat(name, value))
    if numbers.shape != (size,):
        raise InvalidInput(f"{name} has {numbers.size} numbers; expected {size}")
    return numbers


def shaped(values: Any, shape: tuple[int, ...]) -> Array:
    """A flat field as an array."""
    return np.array(values, float).reshape(shape)


def task_shapes(n: int, m: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the fields of a ``TaskSpace`` answer for n joints and m axes, a point each."""
    return {
        "pose": (7,), "jacobian": (m, n), "twist": (m,), "bias": (m,), "inertia": (m, m),
        "coriolis": (m,), "gravity": (m,), "inverse": (n, m), "null_space": (n, n),
        "manipulability": (), "condition": (), "damped": (), "effective_mass": (),
        "effective_mass_bounded": (),
    }  # fmt: skip
