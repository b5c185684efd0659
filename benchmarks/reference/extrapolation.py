# SPDX-License-Identifier: Apache-2.0
"""Gragg's midpoint rule, extrapolated: a method of any order, in any floating-point type.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I (1993), section II.9. It
shares no coefficients with the methods that are measured.
"""

from collections.abc import Callable

import numpy as np

Vector = np.ndarray


def integrate(
    f: Callable[[Vector], Vector], x: Vector, duration: float, steps: int, columns: int
) -> Vector:
    """Solve x' = f(x) over ``duration`` with ``steps`` equal steps of order ``2 * columns``."""
    h = x.dtype.type(duration) / steps
    for _ in range(steps):
        x = _step(f, x, h, columns)
    return x


def _step(f: Callable[[Vector], Vector], x: Vector, h: np.floating, columns: int) -> Vector:
    slope = f(x)
    row: list[Vector] = []
    for j in range(1, columns + 1):
        above = row
        row = [_midpoint(f, x, slope, h, 2 * j)]
        for k in range(1, j):
            # h² expansion: (n_j / n_{j-k})² - 1 with n_j = 2 j
            ratio = x.dtype.type(j * j) / ((j - k) * (j - k)) - 1
            row.append(row[k - 1] + (row[k - 1] - above[k - 1]) / ratio)
    return row[-1]


def _midpoint(
    f: Callable[[Vector], Vector], x: Vector, slope: Vector, h: np.floating, n: int
) -> Vector:
    d = h / n
    before, now = x, x + d * slope
    for _ in range(n - 1):
        before, now = now, before + 2 * d * f(now)
    return now
