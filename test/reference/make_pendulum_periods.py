# SPDX-License-Identifier: Apache-2.0
"""Write pendulum_periods.json: how much longer wide swings take than small ones, in closed form.

The period of a pendulum that swings to the angle a is 2 pi sqrt(l/g) times 2 K(sin²(a/2)) / pi
(Landau and Lifshitz, Mechanics, §11; K with the parameter m = k²). Run:
python make_pendulum_periods.py
"""

from __future__ import annotations

import json
from pathlib import Path

from mpmath import ellipk, mp, mpf, nstr, pi, quad, radians, sin, sqrt

DEGREES = (1, 10, 30, 60, 90, 120, 150, 170, 179)


def ratio(degrees: int) -> mpf:
    """Period over the period of small swings."""
    return 2 * ellipk(sin(radians(mpf(degrees)) / 2) ** 2) / pi


def by_quadrature(degrees: int) -> mpf:
    """The same from the integral that K stands for."""
    m = sin(radians(mpf(degrees)) / 2) ** 2
    return 2 / pi * quad(lambda x: 1 / sqrt(1 - m * sin(x) ** 2), [0, pi / 4, pi / 2])


def main() -> None:
    """Compute with 30 digits, keep 20."""
    mp.dps = 30
    for degrees in (10, 90, 150):
        assert abs(ratio(degrees) / by_quadrature(degrees) - 1) < mpf(10) ** -20
    content = {
        "about": "period over 2 pi sqrt(l/g) by the angle of swing in degrees",
        "ratio": {a: nstr(ratio(a), 20) for a in DEGREES},
    }
    path = Path(__file__).with_name("pendulum_periods.json")
    path.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
