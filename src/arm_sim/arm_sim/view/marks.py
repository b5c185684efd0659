# SPDX-License-Identifier: Apache-2.0
"""Positions of joints, forces, springs and active stops at an instant, by Pinocchio."""

from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.equations.constraint import across
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.scene import constraint as schema
from arm_sim.stepping.contact_forces import ContactForce


@frozen
class Instant:
    """The data of a picture of an arm at one instant; what is empty is unknown.

    Attributes:
        q: Joint positions in [rad] or [m], shape (n,).
        contacts: Points in the world in [m], forces on the arm there in [N], and normals of the
            planes there, each as long as the coefficient of static friction, shape (k, 3, 3).
        multipliers: λ of the constraints, shape (m,).
        stop_torque: Torques of stops in [N m] or [N], shape (n,).
    """

    q: Array
    contacts: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    multipliers: Array = field(default_factory=lambda: np.zeros(0))
    stop_torque: Array = field(default_factory=lambda: np.zeros(0))


def contacts_of(model: ArmModel, forces: Sequence[ContactForce]) -> Array:
    """Contacts of a scene as an ``Instant`` has them, shape (k, 3, 3)."""
    rows = [
        (x.point, x.force, contact.sticking * (x.force - x.tangential) / (x.normal or 1.0))
        for x, (_, contact) in zip(forces, model.scene.contacts, strict=True)
    ]
    return np.array(rows).reshape(-1, 3, 3)


@frozen
class ArmMarks:
    """Marks of an arm at an instant; positions in the world, in [m]."""

    position: Array  # of Pinocchio's joints, the world first, shape (k, 3)
    rotation: Array  # of their axes as quaternions w, x, y, z, shape (k, 4)
    hand: Array  # shape (3,)
    constraints: Array  # points and forces in [N] on the first frames, shape (r, 2, 3)
    springs: Array  # both ends of each, shape (s, 2, 3)
    at_stop: NDArray[np.bool_]  # whether joints are at a stop, shape (n,)


class Marker:
    """Computes the marks of an arm; for one thread."""

    def __init__(self, model: ArmModel) -> None:
        self.model, self._data = model, pin.Data(model.pin)
        self.hand = outermost(model)  # whose path is shown
        self._rows = ConstraintRows(model) if model.scene.bilateral else None

    def at(self, instant: Instant) -> ArmMarks:
        """The marks at an instant."""
        data, q = self._kinematics(instant.q), np.asarray(instant.q, dtype=float)
        springs = [
            [self._point(*end) for end in zip(spring.frames, spring.points, strict=True)]
            for spring in self.model.springs.points
        ]
        at_stop = self.model.stops.touched(q)
        if len(instant.stop_torque):
            at_stop = at_stop & (instant.stop_torque != 0.0)
        return ArmMarks(
            np.array([place.translation for place in data.oMi]),
            np.array([np.roll(pin.Quaternion(place.rotation).coeffs(), 1) for place in data.oMi]),
            self._point(self.hand, (0.0, 0.0, 0.0)),
            self._constraint_forces(instant.multipliers),
            np.array(springs).reshape(-1, 2, 3),
            at_stop,
        )

    def extent(self, q: Array, carried: Iterable[tuple[int, Array]] = ()) -> Array:
        """Points that the arm reaches around at joint positions, shape (k, 3).

        Origins of joints and frames, points equally far beyond the centre of mass of each body,
        and those that Pinocchio's joints of some numbers carry, shape (c, 3).
        """
        data = self._kinematics(q)
        ends = [
            place.act(2.0 * body.lever)
            for place, body in zip(data.oMi, self.model.pin.inertias, strict=True)
            if body.mass > 0.0
        ]
        further = [data.oMi[joint].act(point) for joint, points in carried for point in points]
        return np.array([*(p.translation for p in (*data.oMi, *data.oMf)), *ends, *further])

    def path(self, q: Iterable[Array]) -> Array:
        """Positions of the hand at joint positions, shape (k, 3)."""
        hand = self.model.frame_index(self.hand)
        places = [self._kinematics(row).oMf[hand].translation.copy() for row in q]
        return np.array(places).reshape(-1, 3)

    def _kinematics(self, q: Array) -> pin.Data:
        configuration = self.model.configuration(np.asarray(q, dtype=float))
        pin.framesForwardKinematics(self.model.pin, self._data, configuration)
        return self._data

    def _point(self, frame: str, point: Sequence[float]) -> Array:
        place = self._data.oMf[self.model.frame_index(frame)]
        return np.asarray(place.act(np.array(point)))

    def _constraint_forces(self, multipliers: Array) -> Array:
        """Points and forces on the first frame of each constraint, shape (r, 2, 3).

        The power of λ is that of the force: λ·A q̇ = f·u̇ with u the first point as seen from the
        second frame. λ is opposed to the motion, see ``Dynamics.constrained_forward``.
        """
        if self._rows is None or not len(multipliers):
            return np.zeros((0, 2, 3))
        first, marks = 0, []
        for constraint, count in zip(self._rows.constraints, self._rows.counts, strict=True):
            own = multipliers[first : first + count]
            first += count
            if isinstance(constraint, schema.CouplingConstraint):
                continue
            (a, b), (p, r) = constraint.frames, constraint.points
            point, other = self._point(a, p), self._point(b, r)
            R = self._data.oMf[self.model.frame_index(b)].rotation
            pull = _slope(constraint, R.T @ (point - other))
            marks.append([point, -R @ (pull.T @ own[: len(pull)])])
        return np.array(marks).reshape(-1, 2, 3)


def _slope(constraint: schema.FrameBased, u: Array) -> Array:
    """Derivative of the position rows of a constraint by u, shape (k, 3)."""
    if isinstance(constraint, schema.LineConstraint):
        return np.asarray(across(constraint.direction))
    if isinstance(constraint, schema.PlaneConstraint):
        return np.array([constraint.normal])
    if isinstance(constraint, schema.DistanceConstraint):
        return u[None] / constraint.distance
    if isinstance(constraint, schema.RollingConstraint):
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
