# SPDX-License-Identifier: Apache-2.0
"""What a client hands out, and how numbers become fields of a request and back."""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from arm_dynamics.exceptions import InvalidInput

Array = NDArray[np.float64]


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
        summary: For people.
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


def vectors(**given: ArrayLike | None) -> dict[str, array[float]]:
    """Flat fields of a request; what is None is left out."""
    return {name: flat(name, value) for name, value in given.items() if value is not None}


def flat(name: str, value: ArrayLike) -> array[float]:
    """Any numbers as a flat field; ``InvalidInput`` if they are none."""
    try:
        numbers = np.ascontiguousarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(f"{name} = {value!r}: numbers of one shape are wanted") from None
    return array("d", numbers.tobytes())


def whole(name: str, value: int, most: int) -> int:
    """A whole number that the message's field holds."""
    if not isinstance(value, int | np.integer) or not 0 <= value <= most:
        raise InvalidInput(f"{name} = {value!r}; a whole number from 0 to {most} is wanted")
    return int(value)


def points(answer: Any, q: ArrayLike) -> tuple[int, ...]:
    """Shape of the question: (n,) or (k, n)."""
    shape, n = np.shape(q), len(answer.joint_names)
    if len(shape) not in (1, 2) or shape[-1] != n:
        raise InvalidInput(f"position has shape {shape}; ({n},) or (k, {n}) is wanted")
    return shape


def fixed(name: str, value: ArrayLike, size: int) -> Array:
    """Numbers for a field of ``size``; ``InvalidInput`` if they are more or fewer."""
    numbers = np.array(flat(name, value))
    if numbers.shape != (size,):
        raise InvalidInput(f"{name} has {numbers.size} numbers; {size} are wanted")
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
