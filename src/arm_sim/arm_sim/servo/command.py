# SPDX-License-Identifier: Apache-2.0
"""Joint commands: position, velocity or effort of each joint, as in ros2_control."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, read_only, real_array
from arm_dynamics.attributes import sealed


@sealed
@dataclass(frozen=True, eq=False)
class JointCommand:
    """Command of all joints; NaN, or None for all joints, means not commanded.

    A commanded position, clipped to the joint's stops with a warning, is tracked by its servo,
    with the velocity, if there is one, as feed-forward; a velocity alone is tracked as such; an
    effort alone is applied directly, as by ``Simulator.step``. An effort beside a position or
    velocity is added to the servo's output. A joint without any command gets no effort.

    Attributes:
        position: Positions in [rad] or [m], shape (n,), or (k, n) with a row for each tick.
        velocity: Velocities in [rad/s] or [m/s], likewise.
        effort: Efforts in the units of ``ArmModel.command_unit``, likewise.
        stamp: Time at which it was sent in [ns]; 0 if unknown.

    Raises:
        InvalidInput: If shapes differ, a number is infinite, or nothing is commanded.
    """

    position: Any = None
    velocity: Any = None
    effort: Any = None
    stamp: int = 0

    def __post_init__(self) -> None:
        """Validate the fields and convert them to arrays of one shape."""
        arrays = {
            name: real_array(name, value)
            for name in ("position", "velocity", "effort")
            if (value := getattr(self, name)) is not None
        }
        if not arrays:
            raise InvalidInput("nothing is commanded; position, velocity or effort is expected")
        shapes = {name: array.shape for name, array in arrays.items()}
        shape = next(iter(shapes.values()))
        if len(set(shapes.values())) > 1 or len(shape) not in (1, 2):
            raise InvalidInput(f"shapes {shapes}; one shape is expected, (n,) or (k, n)")
        for name in ("position", "velocity", "effort"):
            array = arrays.get(name, np.full(shape, np.nan))
            if np.isinf(array).any():
                raise InvalidInput(f"{name} is {array}; numbers, or NaN for none, are expected")
            object.__setattr__(self, name, read_only(np.array(array, dtype=float)))

    @classmethod
    def of_rows(cls, position: Array, velocity: Array, effort: Array, stamp: int) -> JointCommand:
        """Create from three valid arrays of shape (n,) that are not modified; for loops."""
        command = object.__new__(cls)
        vars(command).update(position=position, velocity=velocity, effort=effort, stamp=stamp)
        return command

    @property
    def stays(self) -> bool:
        """Whether it remains valid without further commands: positions to hold, or standstill.

        A lasting effort or speed does not.
        """
        placed = np.isfinite(self.position) | (self.velocity == 0.0)
        return bool(np.all(placed | (np.isnan(self.velocity) & np.isnan(self.effort))))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of each of the three fields."""
        return tuple(np.shape(self.position))

    def rows(self, ticks: int, n: int, dt: float) -> Iterator[JointCommand]:
        """One command for each tick.

        Args:
            ticks: Number of ticks.
            n: Number of joints.
            dt: Length of a tick in [s], for messages.

        Raises:
            InvalidInput: If the shape does not fit.
        """
        if self.shape == (n,):
            return (self for _ in range(ticks))
        if self.shape != (ticks, n):
            raise InvalidInput(
                f"commands of shape {self.shape}; expected ({n},) or ({ticks}, {n}): "
                f"a row for each time step of {dt} s"
            )
        table = zip(self.position, self.velocity, self.effort, strict=True)
        return (JointCommand.of_rows(*row, stamp=0) for row in table)
