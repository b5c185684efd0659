# SPDX-License-Identifier: Apache-2.0
"""Newton on Warp: Featherstone's algorithm, semi-implicit, in single precision."""

from __future__ import annotations

import newton
import numpy as np
import warp

from benchmarks.peers.base import TICK, Contestant, Vector, halvings
from benchmarks.robots.models import Robot

warp.config.log_level = warp.LOG_ERROR  # before its first use, which prints
FREE = ("joint_limit_ke", "joint_limit_kd", "joint_target_ke", "joint_target_kd", "joint_armature")
"""What it gives joints that a robot file does not ask for."""


def contestants() -> list[Contestant]:
    """Its solver in joint coordinates."""
    note = "one step call a step from Python, single precision"
    steps, held = halvings(8e-3, 1e-3), halvings(TICK, 2.5e-4)
    return [Contestant("Newton", "Euler", "step", steps, held, NewtonTrial, note)]


class World:
    """Arms side by side, without contacts, limits and what Newton adds to joints.

    ``length`` is that of a step in [s], ``device`` one of Warp's.
    """

    def __init__(self, robot: Robot, arms: int, device: str, length: float) -> None:
        arm, builder = (newton.ModelBuilder(gravity=(0.0, 0.0, -9.81)) for _ in range(2))
        arm.add_urdf(robot.urdf, floating=False, enable_self_collisions=False)
        builder.replicate(arm, arms)
        self.model = builder.finalize(device=device)
        for name in FREE:
            getattr(self.model, name).zero_()
        self.solver = newton.solvers.SolverFeatherstone(self.model, angular_damping=0.0)
        self.now, self.next = self.model.state(), self.model.state()
        self.control, self.length = self.model.control(), length

    def reset(self, q: Vector, v: Vector) -> None:
        """Start again; one row for each arm, or one arm."""
        self.now.joint_q.assign(q.astype(np.float32).ravel())
        self.now.joint_qd.assign(v.astype(np.float32).ravel())
        newton.eval_fk(self.model, self.now.joint_q, self.now.joint_qd, self.now)

    def torque(self, tau: Vector) -> None:
        """Torques from now on, shaped as in ``reset``."""
        self.control.joint_f.assign(tau.astype(np.float32).ravel())

    def step(self) -> None:
        """One step of all arms."""
        self.solver.step(self.now, self.next, self.control, None, self.length)
        self.now, self.next = self.next, self.now

    def states(self) -> tuple[warp.array, warp.array]:
        """Positions and velocities now, arm by arm."""
        return self.now.joint_q, self.now.joint_qd


class NewtonTrial:
    """A world with one arm."""

    def __init__(self, robot: Robot, step: float) -> None:
        """Load the robot."""
        self.world, self.n = World(robot, 1, "cpu", step), robot.n

    def reset(self, q: Vector, v: Vector) -> None:  # noqa: D102
        self.world.reset(q, v)

    def advance(self, duration: float) -> None:  # noqa: D102
        for _ in range(round(duration / self.world.length)):
            self.world.step()

    def replay(self, torques: Vector) -> None:  # noqa: D102
        for tau in torques:
            self.world.torque(tau)
            self.advance(TICK)
        self.world.torque(np.zeros(self.n))

    def state(self) -> tuple[Vector, Vector]:  # noqa: D102
        q, v = self.world.states()
        return q.numpy().astype(float), v.numpy().astype(float)

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:  # noqa: D102
        self.reset(q, v)
        self.world.torque(tau)
        self.world.step()
        self.world.torque(np.zeros(self.n))
        return (self.state()[1] - v.astype(np.float32)) / self.world.length
