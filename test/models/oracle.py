# SPDX-License-Identifier: Apache-2.0
"""The same robot through Pinocchio alone: the full tree, and a projection for what does not move
on its own.

Pinocchio holds every joint of the URDF as free. Locked joints and followers (mimic) are left to a
linear map ``positions = P q + c``, so that torques are ``P^T tau`` and the mass matrix is ``P^T M
P``. Nothing here is shared with the code under test but the scene, which is plain data.
"""

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from arm_dynamics import Scene

Array = np.ndarray


class Oracle:
    """Dynamics of a scene from the full Pinocchio model and a projection.

    Attributes:
        joint_names: Names of the joints that move on their own, in Pinocchio's order.
        n: How many.
        P: Speeds of all joints by speeds of those, shape (all, n).
        c: Positions of all joints when those are at zero, shape (all,).
    """

    def __init__(self, scene: Scene) -> None:
        self.model = pin.buildModelFromXML(scene.robot.urdf)
        self.model.gravity.linear = np.array(scene.gravity)
        self.names = list(self.model.names)[1:]
        self.levels = np.array([self.model.friction, self.model.friction])  # forwards, backwards
        for i, name in enumerate(self.names):
            said = scene.joint(name)
            self.model.armature[i] = said.armature or 0.0
            if said.friction.viscous is not None:
                self.model.damping[i] = said.friction.viscous
            if said.friction.coulomb is not None:
                self.levels[:, i] = _sides(said.friction.coulomb)
        self._add_payloads(scene)
        self.data = self.model.createData()
        self._project(scene)

    def _add_payloads(self, scene: Scene) -> None:
        for load in scene.payloads:
            xx, xy, xz, yy, yz, zz = load.inertia
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            frame = self.model.frames[self.model.getFrameId(load.frame)]
            body = pin.Inertia(load.mass, np.array(load.com), tensor)
            self.model.appendBodyToJoint(frame.parentJoint, body, frame.placement)

    def _project(self, scene: Scene) -> None:
        rules = _mimics(scene.robot.urdf)
        held = set(scene.robot.lock)
        self.joint_names = [n for n in self.names if n not in rules and n not in held]
        self.n = len(self.joint_names)
        rows = {name: np.eye(self.n)[i] for i, name in enumerate(self.joint_names)}
        start = scene.initial.position

        def place(name: str) -> tuple[Array, float]:
            if name in rows:
                return rows[name], 0.0
            if name in held and name not in rules:
                return np.zeros(self.n), start.get(name, 0.0)
            leader, multiplier, offset = rules[name]
            row, at = place(leader)
            return multiplier * row, multiplier * at + offset

        placed = [place(name) for name in self.names]
        self.P = np.array([row for row, _ in placed]).reshape(len(placed), self.n)
        self.c = np.array([at for _, at in placed])

    def full(self, q: Array) -> Array:
        """Pinocchio's configuration: continuous joints as cosine and sine."""
        parts = []
        for joint, at in zip(self.model.joints[1:], self.P @ q + self.c, strict=True):
            parts.append([at] if joint.nq == 1 else [np.cos(at), np.sin(at)])
        return np.concatenate(parts)

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


def _mimics(urdf: str) -> dict[str, tuple[str, float, float]]:
    rules = {}
    for joint in ElementTree.fromstring(urdf.encode()).findall("joint"):
        rule = joint.find("mimic")
        if rule is not None:
            factors = float(rule.get("multiplier", "1")), float(rule.get("offset", "0"))
            rules[str(joint.get("name"))] = (str(rule.get("joint")), *factors)
    return rules
