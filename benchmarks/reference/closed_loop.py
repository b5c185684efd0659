# SPDX-License-Identifier: Apache-2.0
"""Computed torque at 1 kHz along a smooth trajectory, the same law for every simulator."""

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from benchmarks.peers.base import TICK, Trial
from benchmarks.robots.models import Robot

AMPLITUDE = 0.3  # [rad]
BANDWIDTH = 20.0  # [rad/s], critically damped
Vector = np.ndarray


@dataclass
class Loop:
    """τ = ID(q, v, a_d + 2ω(v_d − v) + ω²(q_d − q)), held for a tick."""

    robot: Robot  # plant and model are the same arm
    ticks: int = 2000
    _data: pin.Data = field(init=False)

    def __post_init__(self) -> None:
        self._data = self.robot.pin.createData()

    def reference(self, t: float) -> tuple[Vector, Vector, Vector]:
        """Position, velocity, acceleration at time t [s]; each joint swings at its own pace."""
        w = 2 * np.pi * (0.4 + 0.1 * np.arange(self.robot.n) / self.robot.n)
        c, s = np.cos(w * t), np.sin(w * t)
        return (
            self.robot.q0 + AMPLITUDE * (1 - c),
            AMPLITUDE * w * s,
            AMPLITUDE * w**2 * c,
        )

    def torque(self, tick: int, q: Vector, v: Vector) -> Vector:
        """The torque [N m] for a tick, from the state at its start."""
        qd, vd, ad = self.reference(tick * TICK)
        a = ad + 2 * BANDWIDTH * (vd - v) + BANDWIDTH**2 * (qd - q)
        return pin.rnea(self.robot.pin, self._data, q, v, a).copy()

    def run(self, trial: Trial) -> tuple[Vector, Vector]:
        trial.reset(self.robot.q0, np.zeros(self.robot.n))
        positions, torques = [self.robot.q0], []
        for k in range(self.ticks):
            torques.append(self.torque(k, *trial.state()))
            trial.replay(torques[-1][None])
            positions.append(trial.state()[0])
        return np.array(positions), np.array(torques)
