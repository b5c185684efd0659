# SPDX-License-Identifier: Apache-2.0
"""MuJoCo: everything that this scene does not need is switched off, and steps roll in C."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import mujoco
import numpy as np
from mujoco import rollout

from benchmarks.peers.base import TICK, Contestant, Vector, halvings
from benchmarks.robots.models import Robot

NEEDLESS = (
    "CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "CONTACT", "SPRING", "DAMPER",
    "ACTUATION", "SENSOR", "MIDPHASE", "ISLAND", "AUTORESET", "EULERDAMP",
)  # fmt: skip
METHODS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
TORQUE = mujoco.mjtState.mjSTATE_QFRC_APPLIED

# A step too long for Euler's method is part of the measurement; MuJoCo would write a log file.
mujoco.set_mju_user_warning(lambda message: None)


def contestants() -> list[Contestant]:
    """The three integrators that MuJoCo's users choose from."""
    first_order = halvings(8e-3, 1.5e-5)
    ticks = halvings(TICK, 1.5e-5)
    steps = {"Euler": first_order, "implicitfast": first_order, "RK4": halvings(8e-3, 1.2e-4)}
    held = {"Euler": ticks, "implicitfast": ticks, "RK4": halvings(TICK, 2.5e-4)}
    return [
        Contestant("MuJoCo", name, "step", steps[name], held[name], partial(MujocoTrial, name))
        for name in METHODS
    ]


def compile_model(robot: Robot, method: str, step: float) -> mujoco.MjModel:
    """The robot as a MuJoCo model with nothing switched on that it does not need."""
    model = mujoco.MjModel.from_xml_string(robot.urdf)
    model.opt.integrator = METHODS[method]
    model.opt.timestep = step
    for name in NEEDLESS:
        model.opt.disableflags |= int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
    return model


class MujocoTrial:
    """``mj_step`` with a step count; replayed torques go through ``mujoco.rollout``."""

    def __init__(self, method: str, robot: Robot, step: float) -> None:
        self.model = compile_model(robot, method, step)
        self.data = mujoco.MjData(self.model)
        self._initial = np.zeros((1, mujoco.mj_stateSize(self.model, STATE)))

    def reset(self, q: Vector, v: Vector) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, v

    def advance(self, duration: float) -> None:
        mujoco.mj_step(self.model, self.data, nstep=round(duration / self.model.opt.timestep))

    def replay(self, torques: Vector) -> None:
        substeps = round(TICK / self.model.opt.timestep)
        control = np.repeat(torques, substeps, axis=0)[None]
        mujoco.mj_getState(self.model, self.data, self._initial[0], STATE)
        states, _ = rollout.rollout(
            self.model, self.data, self._initial, control, control_spec=int(TORQUE)
        )
        mujoco.mj_setState(self.model, self.data, states[0, -1], STATE)

    def state(self) -> tuple[Vector, Vector]:
        return self.data.qpos.copy(), self.data.qvel.copy()

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        self.reset(q, v)
        self.data.qfrc_applied[:] = tau
        mujoco.mj_forward(self.model, self.data)
        return self.data.qacc.copy()


def fleet(method: str, step: float, steps: int) -> Callable[[Robot], MujocoFleet]:
    """A maker of fleets with one integrator."""
    return lambda robot: MujocoFleet(robot, method, step, steps)


class MujocoFleet:
    """MuJoCo's ``rollout`` on one core; every buffer is made beforehand."""

    def __init__(self, robot: Robot, method: str, step: float, steps: int) -> None:
        self.model = compile_model(robot, method, step)
        self.data = [mujoco.MjData(self.model)]
        self.pool = rollout.Rollout(nthread=0)
        self.steps, self.n = steps, robot.n
        self.memory = lru_cache(maxsize=1)(self._memory)

    def __call__(self, q0: np.ndarray, v0: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """States after every step, (arms, steps, 1 + 2n): time, q, v."""
        initial, control, states = self.memory(len(q0))
        initial[:, 1 : 1 + self.n], initial[:, 1 + self.n :] = q0, v0
        control[:] = tau[:, None]
        self.pool.rollout(
            [self.model] * len(q0), self.data, initial, control, control_spec=int(TORQUE),
            state=states, skip_checks=True, nstep=self.steps,
        )  # fmt: skip
        return states

    def _memory(self, arms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        size = mujoco.mj_stateSize(self.model, STATE)
        held = np.zeros((arms, self.steps, self.n))
        return np.zeros((arms, size)), held, np.zeros((arms, self.steps, size))
