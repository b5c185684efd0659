# SPDX-License-Identifier: Apache-2.0
"""A command of joints: a position, a velocity or an effort of each, as ros2_control has them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, read_only, real_array


@dataclass(frozen=True, eq=False)
class JointCommand:
    """What joints are commanded; NaN, or None for all of them, is not commanded.

    A joint with a position is led there by its servo, and the velocity, where there is one, is
    that of the motion; a joint with a velocity alone is led to move so; a joint with an effort
    alone gets it, as from ``Simulator.step``. An effort beside a position or velocity is added to
    what the servo commands. A joint without any gets no effort.

    Attributes:
        position: In [rad] or [m], shape (n,), or (k, n) with a row for each tick.
        velocity: In [rad/s] or [m/s], likewise.
        effort: In the units of ``ArmModel.command_unit``, likewise.
        stamp: When it was sent in [ns]; 0: that is not known.

    Raises:
        InvalidInput: If shapes differ, a number is infinite, or nothing is commanded.
    """

    position: Any = None
    velocity: Any = None
    effort: Any = None
    stamp: int = 0

    def __post_init__(self) -> None:
        """Check what was given, and make it arrays of one shape."""
        given = {
            name: real_array(name, value)
            for name in ("position", "velocity", "effort")
            if (value := getattr(self, name)) is not None
        }
        if not given:
            raise InvalidInput("nothing is commanded; position, velocity or effort is expected")
        shapes = {name: array.shape for name, array in given.items()}
        shape = next(iter(shapes.values()))
        if len(set(shapes.values())) > 1 or len(shape) not in (1, 2):
            raise InvalidInput(f"shapes {shapes}; one shape is expected, (n,) or (k, n)")
        for name in ("position", "velocity", "effort"):
            array = given.get(name, np.full(shape, np.nan))
            if np.isinf(array).any():
                raise InvalidInput(f"{name} is {array}; numbers, or NaN for none, are expected")
            object.__setattr__(self, name, read_only(np.array(array, dtype=float)))

    @classmethod
    def of_rows(cls, position: Array, velocity: Array, effort: Array, stamp: int) -> JointCommand:
        """From three checked arrays of shape (n,) that nobody changes, in a loop."""
        command = object.__new__(cls)
        vars(command).update(position=position, velocity=velocity, effort=effort, stamp=stamp)
        return command

    @property
    def stays(self) -> bool:
        """Whether it still means the same when nothing follows: places to hold, or standstill.

        An effort, or a speed, that goes on for ever is not meant to.
        """
        placed = np.isfinite(self.position) | (self.velocity == 0.0)
        return bool(np.all(placed | (np.isnan(self.velocity) & np.isnan(self.effort))))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of each of the three."""
        return tuple(np.shape(self.position))

    def rows(self, ticks: int, n: int, dt: float) -> Iterator[JointCommand]:
        """The command of each tick.

        Args:
            ticks: How many.
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
                f"a row for each tick of {dt} s"
            )
        both = zip(self.position, self.velocity, self.effort, strict=True)
        return (JointCommand.of_rows(*row, stamp=0) for row in both)
