# SPDX-License-Identifier: Apache-2.0
"""Print the constants of ``src/arm_dynamics/arm_dynamics/native/sincos.h``.

Sine and cosine are wanted on [-pi/4, pi/4], with z = x^2, in the forms

    sin x = x + x^3 P(z)
    cos x = 1 - z/2 + z^2 Q(z)

where P and Q are polynomials of degree 5 whose largest weighted error is as small as it can be.
They are found by the exchange algorithm of Remez (Cheney, Introduction to Approximation Theory,
1966, chapter 3) in 60 decimal digits. pi/2 is split into a number of 33 bits and the rest, so that
small multiples of the first part are exact.

Run it with ``python tools/sincos_coefficients.py``; it needs mpmath.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp

DIGITS = 60
TERMS = 6
ROUNDS = 30
GRID = 400
HIGH_FRACTION_BITS = 32

Function = Callable[[mp.mpf], mp.mpf]


def minimax(
    function: Function, weight: Function, low: mp.mpf, high: mp.mpf, terms: int = TERMS
) -> tuple[list[mp.mpf], mp.mpf]:
    """Find the polynomial p that minimizes the largest |weight (p - function)| on an interval.

    Args:
        function: What to approximate.
        weight: Weight of the error; not zero on the interval.
        low: Left end of the interval.
        high: Right end of the interval.
        terms: Number of coefficients.

    Returns:
        Coefficients, lowest power first, and the largest weighted error on a grid.
    """
    points = _chebyshev_points(low, high, terms + 1)
    grid = [low + (high - low) * k / mp.mpf(GRID) for k in range(GRID + 1)]
    for _ in range(ROUNDS):
        coefficients = _levelled(function, weight, points, terms)
        errors = [weight(t) * (_value(coefficients, t) - function(t)) for t in grid]
        extremes = [grid[k] for k in _extremes(errors)]
        if len(extremes) != terms + 1:
            break
        points = extremes
    return coefficients, max(abs(error) for error in errors)


def _chebyshev_points(low: mp.mpf, high: mp.mpf, count: int) -> list[mp.mpf]:
    middle, half = (low + high) / 2, (high - low) / 2
    angles = [mp.pi * (2 * k + 1) / (2 * count) for k in range(count)]
    return [middle + half * mp.cos(angle) for angle in reversed(angles)]


def _levelled(
    function: Function, weight: Function, points: list[mp.mpf], terms: int
) -> list[mp.mpf]:
    """Coefficients whose weighted error is of one size and alternating sign at ``points``."""
    equations = mp.matrix(terms + 1, terms + 1)
    right = mp.matrix(terms + 1, 1)
    for i, point in enumerate(points):
        for power in range(terms):
            equations[i, power] = point**power
        equations[i, terms] = (-1) ** i / weight(point)
        right[i] = function(point)
    return list(mp.lu_solve(equations, right))[:terms]


def _value(coefficients: list[mp.mpf], t: mp.mpf) -> mp.mpf:
    return sum(c * t**power for power, c in enumerate(coefficients))


def _extremes(errors: list[mp.mpf]) -> list[int]:
    """Index of the largest magnitude in each run of numbers of one sign."""
    found: list[int] = []
    for k, error in enumerate(errors):
        if not found or mp.sign(error) != mp.sign(errors[found[-1]]):
            found.append(k)
        elif abs(error) > abs(errors[found[-1]]):
            found[-1] = k
    return found


def main() -> None:
    """Print both polynomials with their errors, and the two parts of pi/2."""
    mp.mp.dps = DIGITS
    # The forms have removable singularities at zero.
    low, high = mp.mpf("1e-12"), (mp.pi / 4) ** 2
    sine, sine_error = minimax(
        lambda z: (mp.sin(mp.sqrt(z)) / mp.sqrt(z) - 1) / z, lambda z: z, low, high
    )
    cosine, cosine_error = minimax(
        lambda z: (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2, lambda z: z**2, low, high
    )
    print("P", [float(c) for c in sine], "error", mp.nstr(sine_error, 3))
    print("Q", [float(c) for c in cosine], "error", mp.nstr(cosine_error, 3))
    quarter = mp.pi / 2
    first = mp.mpf(int(quarter * 2**HIGH_FRACTION_BITS)) / 2**HIGH_FRACTION_BITS
    for name, part in (("first part of pi/2", first), ("the rest", quarter - first)):
        print(name, float(part), float(part).hex())


if __name__ == "__main__":
    main()
