# SPDX-License-Identifier: Apache-2.0
"""The rigid bodies, by Pinocchio: every joint of the URDF free, and a map to those that are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from .description import mimics

Array = np.ndarray
AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Tree:
    """Inertia and bias of the independent joints: all positions are P q + c.

    Attributes:
        names: Independent joints in Pinocchio's order.
        n: How many.
        P: Speeds of all joints by those of the independent ones.
        c: Positions of all joints where those are zero.
    """

    def __init__(self, scene: Mapping[str, Any], armature: Mapping[str, float]) -> None:
        robot = scene["robot"]
        self.model = pin.buildModelFromXML(robot["urdf"])
        self.model.gravity.linear = np.array(scene.get("gravity", (0.0, 0.0, -9.81)), dtype=float)
        for load in scene.get("payloads", ()):
            self._carry(load)
        self.data = self.model.createData()
        every = list(self.model.names)[1:]
        rules, held = mimics(robot["urdf"]), set(robot.get("lock", ()))
        self.names = [name for name in every if name not in rules and name not in held]
        self.n = len(self.names)
        start = scene.get("initial", {}).get("position", {})

        def place(name: str) -> tuple[Array, float]:
            if name in rules:
                leader, factor, offset = rules[name]
                row, at = place(leader)
                return factor * row, factor * at + offset
            if name in held:
                return np.zeros(self.n), start.get(name, 0.0)
            return np.eye(self.n)[self.names.index(name)], 0.0

        placed = [place(name) for name in every]
        self.P = np.array([row for row, _ in placed])
        self.c = np.array([at for _, at in placed])
        rotors = np.array([armature.get(name, 0.0) for name in every])
        self._armature = self.P.T @ (rotors[:, None] * self.P)
        self._upper = np.triu(np.ones((self.model.nv,) * 2), 1) + 0.5 * np.eye(self.model.nv)
        self._angles = any(j.nq != 1 for j in self.model.joints[1:])

    def _carry(self, load: Mapping[str, Any]) -> None:
        xx, xy, xz, yy, yz, zz = load.get("inertia", (0.0,) * 6)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        frame = self.model.frames[self.model.getFrameId(load["frame"])]
        body = pin.Inertia(load["mass"], np.array(load.get("com", (0.0,) * 3)), tensor)
        self.model.appendBodyToJoint(frame.parentJoint, body, frame.placement)

    def full(self, q: Array) -> Array:
        """Pinocchio's configuration; a continuous joint is a cosine and a sine there."""
        at = self.P @ q + self.c
        if not self._angles:
            return at
        pairs = zip(self.model.joints[1:], at, strict=True)
        return np.concatenate([[x] if j.nq == 1 else [np.cos(x), np.sin(x)] for j, x in pairs])

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

    def __init__(self, tree: Tree, frame: str, at: Sequence[float]) -> None:
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
