# SPDX-License-Identifier: Apache-2.0
"""Timing laws: the path parameter over time, from rest to rest."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from arm_dynamics.arrays import positive
from arm_dynamics.attributes import frozen


class Timing(Protocol):
    """Path parameter u(t), from 0 to 1."""

    @property
    def duration(self) -> float:
        """Duration in [s]."""

    def at(self, t: float) -> tuple[float, float, float]:
        """u, du/dt in [1/s] and d²u/dt² in [1/s²] at the time ``t`` in [s]."""

    def slower(self, stretch: float) -> Timing:
        """The timing with all times multiplied by ``stretch``."""


@frozen
class Quintic:
    """u = 10 s³ - 15 s⁴ + 6 s⁵ with s = t / T: no jump of acceleration anywhere.

    Attributes:
        duration: T in [s].
    """

    duration: float

    @classmethod
    def within(cls, length: float, speed: float, acceleration: float) -> Quintic:
        """The fastest within limits: peaks 15/8 L/T and 10/√3 L/T² (Craig, section 7.3).

        Args:
            length: Path length in [m] or [rad].
            speed: Largest speed in [m/s] or [rad/s].
            acceleration: Largest acceleration along the path in [m/s²] or [rad/s²].
        """
        _check(length=length, speed=speed, acceleration=acceleration)
        return cls(max(15 / 8 * length / speed, np.sqrt(10 / np.sqrt(3) * length / acceleration)))

    def at(self, t: float) -> tuple[float, float, float]:
        """u, du/dt in [1/s] and d²u/dt² in [1/s²] at the time ``t`` in [s]."""
        T = self.duration
        s = min(max(t / T, 0.0), 1.0)
        return (
            s**3 * (10.0 - 15.0 * s + 6.0 * s * s),
            30.0 * s * s * (1.0 - s) ** 2 / T,
            60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / T**2,
        )

    def slower(self, stretch: float) -> Quintic:
        """The timing with all times multiplied by ``stretch``."""
        return Quintic(self.duration * stretch)


@frozen
class Trapezoid:
    """Constant acceleration, constant speed, constant deceleration (a triangle where it is short).

    Attributes:
        duration: T in [s].
        ramp: Time of the acceleration in [s], at most T/2.
    """

    duration: float
    ramp: float

    @classmethod
    def within(cls, length: float, speed: float, acceleration: float) -> Trapezoid:
        """The fastest within limits; arguments as of ``Quintic.within``."""
        _check(length=length, speed=speed, acceleration=acceleration)
        if speed**2 >= length * acceleration:
            ramp = float(np.sqrt(length / acceleration))
            return cls(2.0 * ramp, ramp)
        return cls(length / speed + speed / acceleration, speed / acceleration)

    def at(self, t: float) -> tuple[float, float, float]:
        """u, du/dt in [1/s] and d²u/dt² in [1/s²] at the time ``t`` in [s]."""
        T, r = self.duration, self.ramp
        rate = 1.0 / (T - r)
        a = rate / r
        if t <= 0.0 or t >= T:
            return (0.0 if t <= 0.0 else 1.0), 0.0, 0.0
        if t < r:
            return 0.5 * a * t * t, a * t, a
        if t <= T - r:
            return rate * (t - 0.5 * r), rate, 0.0
        left = T - t
        return 1.0 - 0.5 * a * left * left, a * left, -a

    def slower(self, stretch: float) -> Trapezoid:
        """The timing with all times multiplied by ``stretch``."""
        return Trapezoid(self.duration * stretch, self.ramp * stretch)


def _check(**numbers: float) -> None:
    for name, value in numbers.items():
        positive(name, value)
