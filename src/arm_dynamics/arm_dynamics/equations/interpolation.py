# SPDX-License-Identifier: Apache-2.0
"""Monotone interpolation: a smooth curve that rises and falls only where the points do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.elementary import Quantity, floor, within


@dataclass(frozen=True)
class Curve:
    """Piecewise cubic curve with continuous slope; constant outside its range, or periodic.

    Fritsch, Butland, "A method for constructing local monotone piecewise cubic interpolants", SIAM
    J. Sci. Stat. Comput. 5(2), 1984: where the points rise on both sides of one, the slope there
    is the harmonic mean of theirs; else it is zero. The curve never leaves the range of two
    neighbours, so that a factor that is positive at the points is positive everywhere.

    Attributes:
        at: Abscissas, increasing, shape (k,).
        values: Values there, shape (k,).
        slopes: Slopes there, shape (k,).
        period: Period after which it repeats; 0 if it does not.
    """

    at: Array
    values: Array
    slopes: Array
    period: float

    @staticmethod
    def through(at: Array, values: Array, period: float = 0.0) -> Curve:
        """The curve through points; ``period`` 0 for one that does not repeat."""
        if not period:
            return Curve(at, values, _slopes(at, values), 0.0)
        around = np.concatenate([at[-1:] - period, at, at[:2] + period])
        repeated = np.concatenate([values[-1:], values, values[:2]])
        slopes = _slopes(around, repeated)[1:-1]
        return Curve(around[1:-1], repeated[1:-1], slopes, period)

    def __call__(self, x: Quantity) -> Quantity:
        """The value at ``x``, a number, array or expression."""
        if self.period:
            x = x - self.period * floor((x - self.at[0]) / self.period)
        total: Quantity = self.values[0]
        pieces = zip(self.at, np.diff(self.at), np.diff(self.values), strict=False)
        for (a, h, rise), m0, m1 in zip(pieces, self.slopes, self.slopes[1:], strict=False):
            t = within((x - a) / h, 0.0, 1.0)
            cubic = t * (h * m0 + t * (3.0 * rise - h * (2.0 * m0 + m1)))
            total = total + cubic + t * t * t * (h * (m0 + m1) - 2.0 * rise)
        return total


def _slopes(at: Array, values: Array) -> Array:
    chords, h = np.diff(values) / np.diff(at), np.diff(at)
    slopes = np.zeros(len(at))
    for i in range(1, len(at) - 1):
        left, right = chords[i - 1], chords[i]
        if left * right > 0.0:
            share = (h[i - 1] + 2.0 * h[i]) / (3.0 * (h[i - 1] + h[i]))
            slopes[i] = left * right / (share * right + (1.0 - share) * left)
    return slopes
