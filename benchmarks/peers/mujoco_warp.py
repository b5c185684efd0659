# SPDX-License-Identifier: Apache-2.0
"""MuJoCo Warp: MuJoCo's Euler step for many arms at once, in single precision."""

from __future__ import annotations

import mujoco
import mujoco_warp
import numpy as np
import warp

from benchmarks.peers.mujoco import compile_model
from benchmarks.robots.models import Robot

UNKNOWN = ("MIDPHASE", "AUTORESET")  # switches of MuJoCo that it refuses


class World:
    """Arms side by side, without contacts and constraints, with steps of ``length`` in [s]."""

    def __init__(self, robot: Robot, arms: int, device: str, length: float) -> None:
        model = compile_model(robot, "Euler", length)
        for name in UNKNOWN:
            model.opt.disableflags &= ~int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
        with warp.ScopedDevice(device):
            self.model = mujoco_warp.put_model(model)
            self.data = mujoco_warp.put_data(model, mujoco.MjData(model), nworld=arms)

    def reset(self, q: np.ndarray, v: np.ndarray) -> None:
        """Start again from positions and velocities, one row for each arm."""
        self.data.qpos.assign(q.astype(np.float32))
        self.data.qvel.assign(v.astype(np.float32))

    def torque(self, tau: np.ndarray) -> None:
        """Torques from now on, one row for each arm."""
        self.data.qfrc_applied.assign(tau.astype(np.float32))

    def step(self) -> None:
        """One step of all arms."""
        with warp.ScopedDevice(self.data.qpos.device):
            mujoco_warp.step(self.model, self.data)

    def states(self) -> tuple[warp.array, warp.array]:
        """Positions and velocities now, arm by arm."""
        return self.data.qpos, self.data.qvel
