# SPDX-License-Identifier: Apache-2.0
"""PyBullet: Featherstone's algorithm with its semi-implicit Euler step."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from benchmarks.peers.base import TICK, Contestant, Vector, halvings
from benchmarks.robots.models import Robot
from benchmarks.robots.urdf import in_file


@contextmanager
def quiet() -> Iterator[None]:
    """Send what C code writes to the standard streams nowhere: Bullet prints while it loads."""
    kept = [os.dup(1), os.dup(2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        for stream, old in zip((1, 2), kept, strict=True):
            os.dup2(old, stream)
            os.close(old)
        os.close(nowhere)


with quiet():
    import pybullet as bullet

UNBOUNDED = 1e9


def contestants() -> list[Contestant]:
    """Its one integrator."""
    note = "one stepSimulation call a step from Python"
    steps = halvings(8e-3, 1.2e-4)
    held = halvings(TICK, 1.2e-4)
    return [Contestant("PyBullet", "Euler", "step", steps, held, BulletTrial, note)]


class BulletTrial:
    """A world of its own with motors, damping and speed limits taken away."""

    def __init__(self, robot: Robot, step: float) -> None:
        """Load the robot."""
        self.step_size = step
        self.client = bullet.connect(bullet.DIRECT)
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        with in_file(robot.urdf) as path, quiet():
            self.body = bullet.loadURDF(
                path, useFixedBase=True, flags=flags, physicsClientId=self.client
            )
        self.joints = list(range(robot.n))
        self._bare(step)

    def __del__(self) -> None:
        """Give the world back."""
        bullet.disconnect(self.client)

    def _bare(self, step: float) -> None:
        c = {"physicsClientId": self.client}
        bullet.setGravity(0, 0, -9.81, **c)
        bullet.setPhysicsEngineParameter(fixedTimeStep=step, numSubSteps=0, **c)
        for joint in [-1, *self.joints]:
            bullet.changeDynamics(
                self.body, joint, linearDamping=0, angularDamping=0, jointDamping=0,
                maxJointVelocity=UNBOUNDED,
                activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, **c,
            )  # fmt: skip
        zeros = [0.0] * len(self.joints)
        bullet.setJointMotorControlArray(
            self.body, self.joints, bullet.VELOCITY_CONTROL, forces=zeros, **c
        )

    def reset(self, q: Vector, v: Vector) -> None:  # noqa: D102
        for joint, position, speed in zip(self.joints, q, v, strict=True):
            bullet.resetJointState(self.body, joint, position, speed, physicsClientId=self.client)

    def advance(self, duration: float) -> None:  # noqa: D102
        for _ in range(round(duration / self.step_size)):
            bullet.stepSimulation(physicsClientId=self.client)

    def replay(self, torques: Vector) -> None:  # noqa: D102
        substeps = round(TICK / self.step_size)
        for tau in torques:
            for _ in range(substeps):  # Bullet forgets forces after every step
                self._torque(tau)
                bullet.stepSimulation(physicsClientId=self.client)

    def state(self) -> tuple[Vector, Vector]:  # noqa: D102
        states = bullet.getJointStates(self.body, self.joints, physicsClientId=self.client)
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:  # noqa: D102
        self.reset(q, v)
        self._torque(tau)
        bullet.stepSimulation(physicsClientId=self.client)
        return (self.state()[1] - v) / self.step_size

    def _torque(self, tau: Vector) -> None:
        bullet.setJointMotorControlArray(
            self.body, self.joints, bullet.TORQUE_CONTROL, forces=tau, physicsClientId=self.client
        )
