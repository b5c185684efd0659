# SPDX-License-Identifier: Apache-2.0
"""What is optimized: a Panda goes to another posture in a second, 100 nodes of 10 ms."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from arm_sim import Simulator
from arm_studies.optimization import ILQR, Phase, QuadraticCost, Trajectory
from benchmarks.measurement.timing import cpu
from benchmarks.robots.models import Robot
from benchmarks.robots.urdf import single_coordinate

NODES, DT, ITERATIONS = 100, 0.01, 3  # after which there is nothing left to improve
WEIGHTS = {"position": 1.0, "velocity": 0.1, "effort": 1e-3, "last": 1e3}
MOTORS = {"command": "torque", "gear_ratio": 100, "rotor_inertia": 2e-5, "rotor_damping": 1e-5}
FRICTION = {"viscous": 0.5}
DRY, SMOOTHING = {"viscous": 0.5, "coulomb": 0.8}, 0.1
LIMIT = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m]


@dataclass(frozen=True)
class Problem:
    """The same cost and guess for every contender: torques of gravity at the start.

    Attributes:
        robot: The arm.
        features: What of a scene's joints is in the model beside the rigid arm.
        smoothing: As for ``ILQR``.
    """

    robot: Robot
    features: dict[str, Any]
    smoothing: float | None = None

    @property
    def goal(self) -> np.ndarray:
        """Where it goes, shape (2n,)."""
        turn = np.array([0.6, 0.4, -0.4, 0.5, 0.3, 0.4, -0.5])
        return np.concatenate([self.robot.q0 + turn, np.zeros(self.robot.n)])

    @cached_property
    def simulator(self) -> Simulator:
        """The arm, of which a tick is a node."""
        plain = {"viscous": 0.0, "coulomb": 0.0}
        joint = {"friction": plain, "limits": {"stop": False}} | self.features
        scene = {"robot": {"urdf": self.robot.urdf}, "joints": {"*": joint}}
        sim = Simulator(scene, integrator="rk4", dt=DT)
        sim.reset(self.robot.q0)
        return sim

    @cached_property
    def guess(self) -> np.ndarray:
        """Torques that would hold the arm where it starts, shape (nodes, n)."""
        return np.tile(self.simulator.dynamics.gravity(self.robot.q0), (NODES, 1))

    @cached_property
    def optimizer(self) -> ILQR:
        """The optimizer, on one core; it never finds that it is done."""
        n, w = self.robot.n, WEIGHTS
        states = np.tile(np.repeat([w["position"], w["velocity"]], n), (NODES + 1, 1))
        states[:-1] *= DT
        states[-1] *= w["last"]
        efforts = np.full((NODES, n), DT * w["effort"])
        cost = QuadraticCost(
            np.tile(self.goal, (NODES + 1, 1)), states, np.zeros((NODES, n)), efforts
        )
        phases = [Phase(self.simulator, NODES)]
        return ILQR(
            phases, cost, low=-LIMIT, high=LIMIT, tolerance=0.0, threads=1,
            smoothing=self.smoothing,
        )  # fmt: skip

    def solve(self, iterations: int = ITERATIONS) -> Trajectory:
        """Improve the guess so many times."""
        sim = self.simulator
        x0 = np.concatenate([self.robot.q0, np.zeros(sim.n)])
        return self.optimizer.solve(x0, self.guess, iterations)

    def iteration(self) -> float:
        """Processor time of an iteration in [s], the guess's motion included."""
        done: list[Trajectory] = []
        seconds = cpu(lambda: done.append(self.solve()))
        return seconds / (len(done[0].costs) - 1)

    def for_others(self) -> dict[str, Any]:
        """The rigid arm's problem as numbers."""
        return {
            "urdf": single_coordinate(self.robot.urdf), "q0": self.robot.q0.tolist(),
            "goal": self.goal.tolist(), "guess": self.guess.tolist(), "dt": DT,
            "iterations": ITERATIONS, "weights": WEIGHTS, "limit": LIMIT.tolist(),
        }  # fmt: skip
