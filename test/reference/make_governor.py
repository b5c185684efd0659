# SPDX-License-Identifier: Apache-2.0
"""Write governor.json: the stiff flyball governor in its three coordinates, by SciPy's Radau.

Both rods hang at the angle a below the horizontal, from hinges at the radius r and the height h,
with masses m at their ends; the slider is at the height s. Around the shaft the moment of inertia
is J(a), and J(a) psi' = p does not change, so that with the weight and with d, the length of a
spring that pulls with K (d - d0) + C d',

    B a'' = p² J'(a) / (2 J²) + 2 g cos a (rod / 2 + m) - 2 pull dd/da,
    M s'' = -M g - 2 pull dd/ds,

where B is the moment of inertia of both rods about their hinges. Geometry and numbers: problem A05
of IFToMM's library of computational benchmark problems. The stiff motion is computed twice, with
tolerances of 1e-12 and 1e-9. Run: python make_governor.py
"""

import json
from math import cos, hypot, pi, sin
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

TIMES = (0.1, 0.5, 1, 2, 5, 10)
ERROR = 1e-9
r, h, m, rod, thick = 0.05, 1.0, 5.0, 0.3, 0.01
M, side, K, C, free, g = 3.0, 0.1, 8e5, 4e4, 0.5, 9.81


def inertia(a: float) -> tuple[float, float]:
    """J(a) and its derivative."""
    x, dx = cos(a), -sin(a)
    J = rod * thick**2 / 6 + M * side**2 / 6  # shaft and slider
    dJ = 0.0
    # Of a rod: its middle, and its own about axes along it and across.
    for mass, at in ((rod, 0.5), (m, 1.0)):
        J += 2 * mass * (r + at * x) ** 2
        dJ += 4 * mass * (r + at * x) * at * dx
    along, across = rod * thick**2 / 6, rod * (1 + thick**2) / 12
    J += 2 * (along * sin(a) ** 2 + across * x**2)
    dJ += 4 * (along - across) * sin(a) * x
    return J, dJ


def rate(_t: float, y: np.ndarray) -> list[float]:
    """Time derivative of (a, s, a', s', psi); p is that of 2 pi rad/s at the beginning."""
    a, s, va, vs, _ = y
    J, dJ = inertia(a)
    p = 2 * pi * inertia(pi / 6)[0]
    wide, high = cos(a) / 2, h - sin(a) / 2 - s  # of a spring, from the slider to the rod
    d = hypot(wide, high)
    by_a = (-wide * sin(a) - high * cos(a)) / (2 * d)
    by_s = -high / d
    pull = 2 * (K * (d - free) + C * (by_a * va + by_s * vs))
    weight = 2 * g * cos(a) * (rod / 2 + m)
    B = 2 * (rod * (1 + thick**2) / 12 + rod / 4 + m)
    return [va, vs, (p**2 * dJ / (2 * J**2) + weight - pull * by_a) / B,
            -g - pull * by_s / M, p / J]  # fmt: skip


def motion(tolerance: float) -> np.ndarray:
    """States at the times, one row each."""
    start = [pi / 6, 0.5, 0.0, 0.0, 0.0]
    with np.errstate(over="ignore"):  # as it looks for what depends on psi, which nothing does
        found = solve_ivp(
            rate, (0.0, max(TIMES)), start, "Radau", TIMES, rtol=tolerance, atol=1e-2 * tolerance
        )
    return found.y.T


def main() -> None:
    """Solve with both tolerances and compare."""
    rough, fine = motion(1e-9), motion(1e-12)
    worst = abs(rough - fine).max()
    assert worst < ERROR, f"the two runs differ by {worst:.1e}"
    content = {
        "about": "a [rad] below the horizontal, s [m], their rates, angle of the shaft [rad]",
        "motion": {t: [float(f"{x:.12g}") for x in y] for t, y in zip(TIMES, fine, strict=True)},
    }
    Path(__file__).with_name("governor.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
