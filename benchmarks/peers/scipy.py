# SPDX-License-Identifier: Apache-2.0
"""SciPy's DOP853 on Pinocchio's ``aba``: what a careful Python user writes."""

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

from benchmarks.peers.base import TICK, Contestant, Vector, decades
from benchmarks.robots.models import Robot


def contestants() -> list[Contestant]:
    note = "the right-hand side is called from Python"
    return [
        Contestant(
            "SciPy", "DOP853 on Pinocchio", "tolerance", decades(-3, -13), decades(-4, -10),
            ScipyTrial, note,
        )
    ]  # fmt: skip


class ScipyTrial:
    """``solve_ivp`` with equal relative and absolute tolerance."""

    def __init__(self, robot: Robot, tolerance: float) -> None:
        self.model, self.data = robot.pin, robot.pin.createData()
        self.tolerance, self.n = tolerance, robot.n
        self.x = np.zeros(2 * robot.n)

    def reset(self, q: Vector, v: Vector) -> None:
        self.x = np.concatenate([q, v])

    def advance(self, duration: float) -> None:
        self._solve(duration, np.zeros(self.n))

    def replay(self, torques: Vector) -> None:
        for tau in torques:
            self._solve(TICK, tau)

    def state(self) -> tuple[Vector, Vector]:
        return self.x[: self.n].copy(), self.x[self.n :].copy()

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        return pin.aba(self.model, self.data, q, v, tau, pin.Convention.WORLD).copy()

    def _solve(self, duration: float, tau: Vector) -> None:
        model, data, n, world = self.model, self.data, self.n, pin.Convention.WORLD

        def rhs(_t: float, x: Vector) -> Vector:
            v = x[n:]
            return np.concatenate([v, pin.aba(model, data, x[:n], v, tau, world)])

        options = {"method": "DOP853", "rtol": self.tolerance, "atol": self.tolerance}
        self.x = solve_ivp(rhs, (0.0, duration), self.x, **options).y[:, -1]
