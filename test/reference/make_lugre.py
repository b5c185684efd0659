# SPDX-License-Identifier: Apache-2.0
"""Write lugre.json: a wheel with LuGre friction under a torque of steps, by SciPy's Radau method.

The law is written out here by itself, with its exact Jacobian. Each stretch of constant torque is
solved with a relative tolerance of 1e-9; solved again with 1e-11 it differs by less than 1e-6 rad.
Run: python make_lugre.py (two minutes)
"""

import json
from dataclasses import asdict, dataclass
from math import e, exp, sqrt
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

# Duration [s] and torque [N m] of each step; half a second in all, in whole milliseconds.
COURSES = {
    "stick": (0.0, ((0.3, 0.6), (0.2, -0.9))),
    "slide": (0.0, ((0.5, 2.0),)),
    "coast": (1.0, ((0.5, 0.0),)),
    "reverse": (0.0, ((0.05, 2.0), (0.1, -2.0), (0.1, 2.0), (0.1, -0.5), (0.1, 1.2), (0.05, 0.0))),
}


@dataclass(frozen=True)
class Wheel:
    """Inertia [kg m²] and coefficients as in docs/concepts/equations.md."""

    J: float
    sigma0: float
    sigma1: float
    viscous: float = 0.4
    coulomb: float = 1.0
    static: float = 1.0
    stribeck_velocity: float = 0.01
    sigma1_velocity: float | None = None

    def rate(self, x: np.ndarray, u: float) -> list[float]:
        """Of angle, speed and deflection."""
        _, v, z = x
        g, _ = self.level(v)
        damping, _ = self.damping(v)
        bend = v - self.sigma0 * abs(v) * z / g
        return [v, (u - self.sigma0 * z - damping * bend - self.viscous * v) / self.J, bend]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Of ``rate``, exactly."""
        _, v, z = x
        (g, dg), (s, ds) = self.level(v), self.damping(v)
        by_z = -self.sigma0 * abs(v) / g
        by_v = 1.0 - self.sigma0 * np.sign(v) * z / g + self.sigma0 * abs(v) * z * dg / g**2
        bend = v + by_z * z
        a_v = (-s * by_v - ds * bend - self.viscous) / self.J
        a_z = (-self.sigma0 - s * by_z) / self.J
        return np.array([[0.0, 1.0, 0.0], [0.0, a_v, a_z], [0.0, by_v, by_z]])

    def level(self, v: float) -> tuple[float, float]:
        """g(v) and its derivative."""
        fall = (self.static - self.coulomb) * exp(-((v / self.stribeck_velocity) ** 2))
        return self.coulomb + fall, -2.0 * v / self.stribeck_velocity**2 * fall

    def damping(self, v: float) -> tuple[float, float]:
        """σ1(v) and its derivative."""
        if self.sigma1_velocity is None:
            return self.sigma1, 0.0
        fading = self.sigma1 * exp(-((v / self.sigma1_velocity) ** 2))
        return fading, -2.0 * v / self.sigma1_velocity**2 * fading


def wheels() -> list[Wheel]:
    """Bristles of all stiffnesses under wheels of all sizes."""
    found = [Wheel(0.1, 1e5, 316.0)]
    for i, sigma0 in enumerate((1e3, 1e4, 1e5, 1e6)):
        for j, inertia in enumerate((1e-3, 1e-2, 1e-1, 1.0)):
            falls = (i + j) % 2 == 1
            sigma1 = (2.0, 0.6)[falls] * sqrt(sigma0 * inertia)
            fading = min(1.0, 4.0 * sqrt(2.0 * e) / sigma1) if falls else None
            found.append(Wheel(inertia, sigma0, sigma1, static=1.5 if falls else 1.0,
                               sigma1_velocity=fading))  # fmt: skip
    return found


def solve(wheel: Wheel, course: str, tolerance: float) -> float:
    """Angle at the end."""
    v0, steps = COURSES[course]
    x = np.array([0.0, v0, 0.0])
    small = tolerance * np.array([1e-3, 1e-3, 1e-3 / wheel.sigma0])
    for duration, u in steps:
        x = solve_ivp(
            lambda t, x, u=u: wheel.rate(x, u), (0.0, duration), x, "Radau", rtol=tolerance,
            atol=small, jac=lambda t, x: wheel.jacobian(x),
        ).y[:, -1]  # fmt: skip
    return float(x[0])


def main() -> None:
    """Solve all and compare with the finer tolerance."""
    content, worst = [], 0.0
    for wheel in wheels():
        ends = {course: solve(wheel, course, 1e-9) for course in COURSES}
        worst = max(worst, *(abs(ends[c] - solve(wheel, c, 1e-11)) for c in ("slide", "reverse")))
        content.append({"wheel": asdict(wheel), "angle": ends})
    assert worst < 1e-6, worst
    about = "angle [rad] after 0.5 s of each course in make_lugre.py"
    text = json.dumps({"about": about, "wheels": content}, indent=1)
    Path(__file__).with_name("lugre.json").write_text(text + "\n")
    print(f"finer tolerance differs by {worst:.1e} rad")


if __name__ == "__main__":
    main()
