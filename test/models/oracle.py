# SPDX-License-Identifier: Apache-2.0
"""The same robot through Pinocchio alone: the full tree, and a projection for what does not move
on its own.

Pinocchio holds every joint of the URDF as free. Locked joints and followers (mimic) are left to a
linear map ``positions = P q + c``, so that torques are ``P^T tau`` and the mass matrix is ``P^T M
P``. Nothing here is shared with the code under test but the scene, which is plain data.
"""

from typing import Any

import numpy as np
import pinocchio as pin

from arm_dynamics import Scene
from reference.independent.tree import FreeTree

Array = np.ndarray


class Oracle(FreeTree):
    """Dynamics of a scene from the full Pinocchio model and a projection."""

    def __init__(self, scene: Scene) -> None:
        robot, loads = scene.robot, [load.model_dump() for load in scene.payloads]
        super().__init__(robot.urdf, scene.gravity, loads, set(robot.lock), scene.initial.position)
        self.levels = np.array([self.model.friction, self.model.friction])
        for i, name in enumerate(self.every):
            said = scene.joint(name)
            self.model.armature[i] = said.armature or 0.0
            if said.friction.viscous is not None:
                self.model.damping[i] = said.friction.viscous
            if said.friction.coulomb is not None:
                self.levels[:, i] = _sides(said.friction.coulomb)

    def rigid(self, q: Array, v: Array, a: Array) -> Array:
        """Torques without friction in [N m] or [N]."""
        args = self.full(q), self.P @ v, self.P @ a
        return self.P.T @ pin.rnea(self.model, self.data, *args)

    def friction(self, v: Array) -> Array:
        """Viscous and Coulomb friction that the drives must overcome."""
        speeds = self.P @ v
        coulomb = np.where(speeds > 0.0, *self.levels) * np.sign(speeds)
        return self.P.T @ (self.model.damping * speeds + coulomb)

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Torques of the whole equation."""
        return self.rigid(q, v, a) + self.friction(v)

    def forward(self, q: Array, v: Array, tau: Array) -> Array:
        """Accelerations under the torques ``tau``."""
        return np.linalg.solve(self.mass_matrix(q), tau - self.inverse(q, v, np.zeros(self.n)))

    def mass_matrix(self, q: Array) -> Array:
        """M(q), shape (n, n)."""
        M = np.triu(pin.crba(self.model, self.data, self.full(q)))
        return self.P.T @ (M + np.triu(M, 1).T) @ self.P

    def coriolis_matrix(self, q: Array, v: Array) -> Array:
        """C(q, v), shape (n, n)."""
        C = pin.computeCoriolisMatrix(self.model, self.data, self.full(q), self.P @ v)
        return self.P.T @ C @ self.P

    def gravity(self, q: Array) -> Array:
        """G(q), shape (n,)."""
        return self.P.T @ pin.computeGeneralizedGravity(self.model, self.data, self.full(q))

    def energy(self, q: Array, v: Array) -> tuple[float, float]:
        """Kinetic and potential energy in [J]."""
        potential = pin.computePotentialEnergy(self.model, self.data, self.full(q))
        return 0.5 * float(v @ self.mass_matrix(q) @ v), float(potential)


def _sides(value: Any) -> tuple[float, float]:
    return (value.positive, value.negative) if hasattr(value, "positive") else (value, value)
