# SPDX-License-Identifier: Apache-2.0
"""Positions of joints, forces, springs and active stops at an instant, by Pinocchio."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Any

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.equations.constraint import across
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.scene.constraint import (
    Contact,
    CouplingConstraint,
    DistanceConstraint,
    FrameBased,
    LineConstraint,
    PlaneConstraint,
    RollingConstraint,
)
from arm_sim.stepping.contact_forces import ContactForce

_NONE = np.zeros((0, 2, 3))


@frozen
class Instant:
    """The data of a picture of an arm at one instant.

    Attributes:
        time: Time in [s].
        q: Joint positions in [rad] or [m], shape (n,).
        contacts: Points in the world in [m] and forces on the arm there in [N], shape (k, 2, 3).
        multipliers: λ of the constraints, shape (m,); empty if unknown.
        stop_torque: Torques of stops in [N m] or [N], shape (n,); empty if unknown.
        cones: Normals of the planes there, away from them, each as long as the coefficient of
            static friction, shape (k, 3); empty if unknown.
    """

    time: float
    q: Array
    contacts: Array = field(default_factory=_NONE.copy)
    multipliers: Array = field(default_factory=lambda: np.zeros(0))
    stop_torque: Array = field(default_factory=lambda: np.zeros(0))
    cones: Array = field(default_factory=lambda: np.zeros((0, 3)))


def cones(forces: Sequence[ContactForce], contacts: Iterable[tuple[str, Contact]]) -> Array:
    """Friction cones of a scene's contacts as an ``Instant`` has them, shape (k, 3)."""
    normals = [
        contact.sticking * (force.force - force.tangential) / (force.normal or 1.0)
        for force, (_, contact) in zip(forces, contacts, strict=True)
    ]
    return np.array(normals).reshape(-1, 3)


def arrows(forces: Sequence[ContactForce]) -> Array:
    """Points and forces of contacts as an ``Instant`` has them, shape (k, 2, 3)."""
    return np.array([[force.point, force.force] for force in forces]).reshape(-1, 2, 3)


@frozen
class Marks:
    """Positions in the world, in [m].

    Attributes:
        position: Positions of Pinocchio's joints, the world first, shape (k, 3).
        rotation: Orientations of their axes as quaternions w, x, y, z, shape (k, 4).
        hand: Position of the hand, shape (3,).
        contacts: Points and forces in [N] there, shape (c, 2, 3).
        constraints: The same of constraints between frames, on the first one, shape (r, 2, 3).
        springs: Both ends of each spring between points, shape (s, 2, 3).
        stops: Joints that are at a stop, shape (t, 3).
    """

    position: Array
    rotation: Array
    hand: Array
    contacts: Array
    constraints: Array
    springs: Array
    stops: Array


class Marker:
    """Computes the marks of an arm; for one thread.

    Args:
        model: The arm.

    Attributes:
        model: The arm.
        hand: Frame whose path is shown: the outermost one of the longest chain.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model, self._data = model, pin.Data(model.pin)
        self.hand = outermost(model)
        self._hand = model.frame_index(self.hand)
        self._rows = ConstraintRows(model) if model.scene.bilateral else None

    def at(self, instant: Instant) -> Marks:
        """The marks at an instant."""
        model, data, q = self.model.pin, self._data, np.asarray(instant.q, dtype=float)
        pin.framesForwardKinematics(model, data, self.model.configuration(q))
        turns = [pin.Quaternion(place.rotation).coeffs() for place in data.oMi]
        springs = [
            [self._point(*end) for end in zip(spring.frames, spring.points, strict=True)]
            for spring in self.model.springs.points
        ]
        stopped = self.model.stops.touched(q)
        if len(instant.stop_torque):
            stopped = stopped & (instant.stop_torque != 0.0)
        joints = [model.getJointId(self.model.joint_names[i]) for i in np.flatnonzero(stopped)]
        return Marks(
            np.array([place.translation for place in data.oMi]),
            np.roll(np.array(turns), 1, axis=1),
            data.oMf[self._hand].translation.copy(),
            np.asarray(instant.contacts, dtype=float),
            self._constraint_forces(instant.multipliers),
            np.array(springs) if springs else _NONE,
            np.array([data.oMi[joint].translation for joint in joints]).reshape(-1, 3),
        )

    def origin(self, frame: str) -> Array:
        """Position of a frame at the last call of ``at``, shape (3,)."""
        place = self._data.oMf[self.model.frame_index(frame)]
        return np.asarray(place.translation.copy())

    def extent(self, q: Array, carried: Iterable[tuple[int, Array]] = ()) -> Array:
        """Points that the arm reaches around at joint positions, shape (k, 3).

        Origins of joints and frames, and points equally far beyond the centre of mass of each
        body.

        Args:
            q: Joint positions, shape (n,).
            carried: Further points, shape (c, 3), in the frames of Pinocchio's joints of these
                numbers.
        """
        data, model = self._data, self.model.pin
        pin.framesForwardKinematics(model, data, self.model.configuration(np.asarray(q)))
        ends = [
            place.act(2.0 * body.lever)
            for place, body in zip(data.oMi, model.inertias, strict=True)
            if body.mass > 0.0
        ]
        further = [data.oMi[joint].act(point) for joint, points in carried for point in points]
        return np.array([*(p.translation for p in (*data.oMi, *data.oMf)), *ends, *further])

    def path(self, q: Iterable[Array]) -> Array:
        """Positions of the hand at joint positions, shape (k, 3)."""
        model, data, places = self.model.pin, self._data, []
        for row in q:
            pin.forwardKinematics(model, data, self.model.configuration(np.asarray(row)))
            places.append(pin.updateFramePlacement(model, data, self._hand).translation.copy())
        return np.array(places).reshape(-1, 3)

    def _point(self, frame: str, point: Sequence[float]) -> Array:
        place = self._data.oMf[self.model.frame_index(frame)]
        return np.asarray(place.act(np.array(point)))

    def _constraint_forces(self, multipliers: Array) -> Array:
        """Points and forces on the first frame of each constraint, shape (r, 2, 3).

        The power of λ is that of the force: λ·A q̇ = f·u̇ with u the first point as seen from the
        second frame. λ is opposed to the motion, see ``Dynamics.constrained_forward``.
        """
        if self._rows is None or not len(multipliers):
            return _NONE
        first, marks = 0, []
        for constraint, count in zip(self._rows.constraints, self._rows.counts, strict=True):
            own = multipliers[first : first + count]
            first += count
            if isinstance(constraint, CouplingConstraint):
                continue
            (a, b), (p, r) = constraint.frames, constraint.points
            point, other = self._point(a, p), self._point(b, r)
            R = self._data.oMf[self.model.frame_index(b)].rotation
            pull = _slope(constraint, R.T @ (point - other))
            marks.append([point, -R @ (pull.T @ own[: len(pull)])])
        return np.array(marks).reshape(-1, 2, 3)


def _slope(constraint: FrameBased, u: Array) -> Array:
    """Derivative of the position rows of a constraint by u, shape (k, 3)."""
    if isinstance(constraint, LineConstraint):
        return np.asarray(across(constraint.direction))
    if isinstance(constraint, PlaneConstraint):
        return np.array([constraint.normal])
    if isinstance(constraint, DistanceConstraint):
        return u[None] / constraint.distance
    if isinstance(constraint, RollingConstraint):
        return np.asarray(across(constraint.normal))
    return np.eye(3)  # a point, or the first rows of a weld


def outermost(model: ArmModel) -> str:
    """The outermost link of the last joint of the longest chain."""
    tree = model.pin
    depth = [0] * tree.njoints
    for i in range(1, tree.njoints):
        depth[i] = depth[tree.parents[i]] + 1

    def outward(frame: Any) -> tuple[int, float]:
        return depth[frame.parentJoint], float(np.linalg.norm(frame.placement.translation))

    links = [frame for frame in tree.frames if frame.type == pin.FrameType.BODY]
    return str(max(links, key=outward).name)
