# SPDX-License-Identifier: Apache-2.0
"""Monotone interpolation: a smooth curve that rises and falls only where the points do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.elementary import Quantity, floor, larger, smaller, within


@dataclass(frozen=True)
class Curve:
    """Piecewise cubic curve with continuous slope; straight beyond its ends, or periodic.

    Fritsch, Butland, "A method for constructing local monotone piecewise cubic interpolants", SIAM
    J. Sci. Stat. Comput. 5(2), 1984: where the points rise on both sides of one, the slope there
    is the harmonic mean of theirs; else it is zero. The curve never leaves the range of two
    neighbours, so that a factor that is positive at the points is positive everywhere.

    Attributes:
        at: Abscissas, increasing, shape (k,).
        values: Values there, shape (k,).
        slopes: Slopes there, shape (k,); the first and the last continue beyond the ends.
        period: Period after which it repeats; 0 if it does not.
    """

    at: Array
    values: Array
    slopes: Array
    period: float

    @staticmethod
    def through(
        at: Array, values: Array, period: float = 0.0, ends: tuple[float, float] = (0.0, 0.0)
    ) -> Curve:
        """The curve through points.

        Args:
            at: Abscissas, increasing, shape (k,).
            values: Values there, shape (k,).
            period: Period after which it repeats; 0 if it does not.
            ends: Slopes at the first and the last point and beyond them; up to three times that
                of the chord next to it keeps the curve monotone. Not for one that repeats.
        """
        if not period:
            slopes = _slopes(at, values)
            slopes[[0, -1]] = ends
            return Curve(at, values, slopes, 0.0)
        around = np.concatenate([at[-1:] - period, at, at[:2] + period])
        repeated = np.concatenate([values[-1:], values, values[:2]])
        slopes = _slopes(around, repeated)[1:-1]
        return Curve(around[1:-1], repeated[1:-1], slopes, period)

    def __call__(self, x: Quantity) -> Quantity:
        """The value at ``x``, a number, array or expression."""
        if self.period:
            x = x - self.period * floor((x - self.at[0]) / self.period)
        total: Quantity = self.values[0]
        for end, slope, beyond in self._straight:
            total = total + slope * beyond(x - end, 0.0)
        pieces = zip(self.at, np.diff(self.at), np.diff(self.values), strict=False)
        for (a, h, rise), m0, m1 in zip(pieces, self.slopes, self.slopes[1:], strict=False):
            t = within((x - a) / h, 0.0, 1.0)
            cubic = t * (h * m0 + t * (3.0 * rise - h * (2.0 * m0 + m1)))
            total = total + cubic + t * t * t * (h * (m0 + m1) - 2.0 * rise)
        return total

    def integral(self, x: Quantity) -> Quantity:
        """Integral from the first point to ``x``; not for a curve that repeats."""
        total: Quantity = self.values[0] * (x - self.at[0])
        for end, slope, beyond in self._straight:
            total = total + 0.5 * slope * beyond(x - end, 0.0) ** 2
        pieces = zip(self.at, np.diff(self.at), np.diff(self.values), strict=False)
        for (a, h, rise), m0, m1 in zip(pieces, self.slopes, self.slopes[1:], strict=False):
            t = within((x - a) / h, 0.0, 1.0)
            half, third = h * m0 / 2.0, (3.0 * rise - h * (2.0 * m0 + m1)) / 3.0
            fourth = (h * (m0 + m1) - 2.0 * rise) / 4.0
            inside = t * t * (half + t * (third + t * fourth))
            total = total + h * inside + rise * larger(x - (a + h), 0.0)
        return total

    @property
    def _straight(self) -> list[tuple[float, float, Callable[[Quantity, float], Quantity]]]:
        """Ends beyond which the curve is not constant: place, slope, and the part beyond it."""
        if self.period:
            return []
        ends = (self.at[0], self.slopes[0], smaller), (self.at[-1], self.slopes[-1], larger)
        return [end for end in ends if end[1]]


def chords(at: Array, values: Array) -> Array:
    """Slopes of the straight lines from point to point, shape (k - 1,)."""
    return np.asarray(np.diff(values) / np.diff(at))


def _slopes(at: Array, values: Array) -> Array:
    steep, h = chords(at, values), np.diff(at)
    slopes = np.zeros(len(at))
    for i in range(1, len(at) - 1):
        left, right = steep[i - 1], steep[i]
        if left * right > 0.0:
            share = (h[i - 1] + 2.0 * h[i]) / (3.0 * (h[i - 1] + h[i]))
            slopes[i] = left * right / (share * right + (1.0 - share) * left)
    return slopes
