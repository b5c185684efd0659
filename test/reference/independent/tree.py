# SPDX-License-Identifier: Apache-2.0
"""The rigid bodies, by Pinocchio: every joint of the URDF free, and a map to those that are."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from .description import mimics

Array = np.ndarray
AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class FreeTree:
    """All joints of a URDF, free in Pinocchio, and a map to those that move on their own."""

    def __init__(
        self, urdf: str, gravity: Sequence[float], payloads: Iterable[Mapping[str, Any]],
        held: Collection[str], start: Mapping[str, float],
    ) -> None:  # fmt: skip
        self.model = pin.buildModelFromXML(urdf)
        self.model.gravity.linear = np.array(gravity, dtype=float)
        for load in payloads:
            self._carry(load)
        self.data = self.model.createData()
        self.every = list(self.model.names)[1:]
        rules = mimics(urdf)
        self.joint_names = [x for x in self.every if x not in rules and x not in held]
        self.n = len(self.joint_names)

        def place(name: str) -> tuple[Array, float]:
            if name in rules:
                leader, factor, offset = rules[name]
                row, at = place(leader)
                return factor * row, factor * at + offset
            if name in held:
                return np.zeros(self.n), start.get(name, 0.0)
            return np.eye(self.n)[self.joint_names.index(name)], 0.0

        placed = [place(name) for name in self.every]
        self.P = np.array([row for row, _ in placed]).reshape(len(placed), self.n)
        self.c = np.array([at for _, at in placed])

    def _carry(self, load: Mapping[str, Any]) -> None:
        xx, xy, xz, yy, yz, zz = load.get("inertia", (0.0,) * 6)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        frame = self.model.frames[self.model.getFrameId(load["frame"])]
        body = pin.Inertia(load["mass"], np.array(load.get("com", (0.0,) * 3)), tensor)
        self.model.appendBodyToJoint(frame.parentJoint, body, frame.placement)

    def full(self, q: Array) -> Array:
        """Pinocchio's configuration; a continuous joint is a cosine and a sine there."""
        pairs = zip(self.model.joints[1:], self.P @ q + self.c, strict=True)
        return np.concatenate([[x] if j.nq == 1 else [np.cos(x), np.sin(x)] for j, x in pairs])


class Tree(FreeTree):
    """Inertia and bias of the independent joints."""

    def __init__(self, scene: Mapping[str, Any], armature: Mapping[str, float]) -> None:
        robot, gravity = scene["robot"], scene.get("gravity", (0.0, 0.0, -9.81))
        start = scene.get("initial", {}).get("position", {})
        super().__init__(
            robot["urdf"], gravity, scene.get("payloads", ()), set(robot.get("lock", ())), start
        )
        rotors = np.array([armature.get(name, 0.0) for name in self.every])
        self._armature = self.P.T @ (rotors[:, None] * self.P)
        self._upper = np.triu(np.ones((self.model.nv,) * 2), 1) + 0.5 * np.eye(self.model.nv)

    def mass(self, q: Array) -> Array:
        """M(q), shape (n, n)."""
        upper = pin.crba(self.model, self.data, self.full(q)) * self._upper
        return self.P.T @ (upper + upper.T) @ self.P + self._armature

    def bias(self, q: Array, v: Array) -> Array:
        """Coriolis, centrifugal and gravity torques, shape (n,)."""
        return self.P.T @ pin.nonLinearEffects(self.model, self.data, self.full(q), self.P @ v)

    def energy(self, q: Array, v: Array) -> float:
        """Kinetic and potential energy in [J]."""
        height = pin.computePotentialEnergy(self.model, self.data, self.full(q))
        return 0.5 * float(v @ self.mass(q) @ v) + float(height)

    def move(self, q: Array, v: Array) -> None:
        """Put all bodies where ``Point`` looks for them."""
        speeds = self.P @ v
        pin.forwardKinematics(self.model, self.data, self.full(q), speeds, np.zeros_like(speeds))
        pin.computeJointJacobians(self.model, self.data, self.full(q))
        pin.updateFramePlacements(self.model, self.data)


class Point:
    """A point of a link, or of the world; ask after ``Tree.move``."""

    def __init__(self, tree: FreeTree, frame: str, at: Sequence[float]) -> None:
        self._tree, self._at = tree, np.array(at, dtype=float)
        self._frame = None if frame == "world" else tree.model.getFrameId(frame)

    def place(self) -> Array:
        """Where it is in the world [m]."""
        if self._frame is None:
            return self._at
        return self._tree.data.oMf[self._frame].act(self._at)

    def jacobian(self) -> Array:
        """Its velocity per joint speed in the world's axes, shape (3, n)."""
        tree = self._tree
        if self._frame is None:
            return np.zeros((3, tree.n))
        J = pin.getFrameJacobian(tree.model, tree.data, self._frame, AXES).reshape(6, -1)
        return (J[:3] - pin.skew(self._arm()) @ J[3:]) @ tree.P

    def curvature(self) -> Array:
        """Its acceleration where no joint accelerates, in [m/s²], shape (3,)."""
        tree = self._tree
        if self._frame is None:
            return np.zeros(3)
        turn = pin.skew(pin.getFrameVelocity(tree.model, tree.data, self._frame, AXES).angular)
        a = pin.getFrameClassicalAcceleration(tree.model, tree.data, self._frame, AXES)
        return a.linear + (pin.skew(a.angular) + turn @ turn) @ self._arm()

    def _arm(self) -> Array:
        return self._tree.data.oMf[self._frame].rotation @ self._at
