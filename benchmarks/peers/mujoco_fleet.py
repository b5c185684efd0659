# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's threaded ``rollout``, with its thread pool kept and every buffer made beforehand."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from mujoco import rollout

from benchmarks.peers.mujoco_peer import STATE, TORQUE, compile_model
from benchmarks.robots import Robot


def builder(method: str, step: float, steps: int) -> Callable[[Robot, int], MujocoFleet]:
    """A maker of fleets with one integrator."""
    return lambda robot, threads: MujocoFleet(robot, method, step, steps, threads)


class MujocoFleet:
    """One thread of the pool for each core that is used."""

    def __init__(self, robot: Robot, method: str, step: float, steps: int, threads: int) -> None:
        """Compile the robot and start the pool."""
        self.model = compile_model(robot, method, step)
        self.data = [mujoco.MjData(self.model) for _ in range(threads)]
        self.pool = rollout.Rollout(nthread=threads if threads > 1 else 0)
        self.steps, self.n = steps, robot.n
        self.buffers: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def __call__(self, q0: np.ndarray, v0: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """States after every step, (arms, steps, 1 + 2n): time, q, v."""
        initial, control, states = self._memory(len(q0))
        initial[:, 1 : 1 + self.n], initial[:, 1 + self.n :] = q0, v0
        control[:] = tau[:, None]
        self.pool.rollout(
            [self.model] * len(q0), self.data, initial, control, control_spec=int(TORQUE),
            state=states, skip_checks=True, nstep=self.steps,
        )  # fmt: skip
        return states

    def _memory(self, arms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if arms not in self.buffers:
            size = mujoco.mj_stateSize(self.model, STATE)
            self.buffers[arms] = (
                np.zeros((arms, size)),
                np.zeros((arms, self.steps, self.n)),
                np.zeros((arms, self.steps, size)),
            )
        return self.buffers[arms]
