# SPDX-License-Identifier: Apache-2.0
"""Bilateral constraints: what they demand of positions, velocities and accelerations.

A constraint is written once, as a position residual φ(q), or, where there is no position to hold
(rolling), as a speed w(q, v) that is linear in v. From it follow, by exact differentiation,

    A(q) v = φ̇ = w = 0          and          A(q) a + γ(q, v) = 0,  γ = Ȧ v.

Sign of the multipliers, here and everywhere: τ = M a + h + Aᵀλ, so λ is what the robot exerts
*against* the constraint: force of the first frame upon the second, in axes of the second.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from arm_dynamics.equations.rigid_body import Rotation, placements
from arm_dynamics.equations.tree import Tree, cross, sparse, turn_of
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.scene.constraint import (
    WORLD,
    Bilateral,
    CouplingConstraint,
    DistanceConstraint,
    FrameBased,
    FrameConstraint,
    LineConstraint,
    PlaneConstraint,
    PointConstraint,
    RollingConstraint,
)
from arm_dynamics.scene.contact import Contact

# Under this, 1 + trace of a rotation counts as half a turn, where the axis is anyone's guess.
HALF_TURN = 1e-9


@dataclass(frozen=True)
class Rows:
    """Constraint equations of a scene; those with a position residual come first.

    Attributes:
        every: φ of all constraints in [m] and [rad], for a look whether they hold.
        residual: φ of those rows that imply all others, shape (h,): of the first h rows.
        jacobian: A, shape (m, n).
        drift: γ = Ȧ v, shape (m,).
    """

    every: ca.SX
    residual: ca.SX
    jacobian: ca.SX
    drift: ca.SX


def rows(
    model: ArmModel, tree: Tree, q: ca.SX, v: ca.SX, active: Callable[[int], ca.SX | float]
) -> Rows:
    """Equations of all constraints of a scene.

    Args:
        model: The robot.
        tree: Its links.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        active: 1 or 0 for the constraint at a place of the scene's list; rows of one that is
            switched off vanish.

    Returns:
        The rows that imply all others, in the order of the scene, rolling last.
    """
    kinematics = Kinematics(model, tree, q)
    every, held, rolling = list[ca.SX](), list[ca.SX](), list[ca.SX]()
    for i, constraint in enumerate(model.scene.constraints):
        if isinstance(constraint, Contact):
            continue
        if isinstance(constraint, Contact):
            continue
        kept = list(model.constraint_rows[i])
        if isinstance(constraint, RollingConstraint):
            rolling.append(active(i) * _slip(constraint, kinematics, q, v)[kept])
        else:
            whole = active(i) * _residual(constraint, model, kinematics, q)
            every.append(whole)
            held.append(whole[kept])
    residual = ca.sparsify(ca.vertcat(ca.SX(0, 1), *held))
    speed = ca.vertcat(ca.jtimes(residual, q, v), ca.SX(0, 1), *rolling)
    J = ca.jacobian(residual, q)
    if rolling:
        J = ca.vertcat(J, ca.jacobian(ca.vertcat(*rolling), v))
    whole = ca.vertcat(ca.SX(0, 1), *every)
    return Rows(whole, residual, ca.sparsify(J), ca.jtimes(speed, q, v))


def complete_rows(
    model: ArmModel, tree: Tree, q: ca.SX, v: ca.SX, places: Sequence[int]
) -> tuple[ca.SX, ca.SX]:
    """A and γ of all rows of some constraints, also of those that others imply.

    Args:
        model: The robot.
        tree: Its links.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        places: Places of the constraints in the scene's list.

    Returns:
        Shapes (m, n) and (m,), in the order of ``places``.
    """
    kinematics = Kinematics(model, tree, q)
    jacobians, drifts = [ca.SX(0, model.n)], [ca.SX(0, 1)]
    for place in places:
        constraint = model.scene.constraints[place]
        assert not isinstance(constraint, Contact)
        if isinstance(constraint, RollingConstraint):
            speed = _slip(constraint, kinematics, q, v)
            jacobians.append(ca.jacobian(speed, v))
        else:
            residual = _residual(constraint, model, kinematics, q)
            speed = ca.jtimes(residual, q, v)
            jacobians.append(ca.jacobian(residual, q))
        drifts.append(ca.jtimes(speed, q, v))
    return ca.vertcat(*jacobians), ca.vertcat(*drifts)


class Kinematics:
    """Placements of frames against one another, as expressions in q."""

    def __init__(self, model: ArmModel, tree: Tree, q: ca.SX) -> None:
        self._model, self._tree = model, tree
        self._pose = placements(tree, q)

    def relative(self, constraint: FrameBased) -> tuple[ca.SX, ca.SX]:
        """Rotation of the first frame in the second, and the first point seen from the second.

        Joints that carry both frames do not enter.
        """
        (i, R_a, p_a), (j, R_b, p_b) = map(self._attached, constraint.frames)
        a, b = (ca.SX(ca.DM(point)) for point in constraint.points)
        common = _common(self._tree, i, j)
        R_a, p_a = self._carried(R_a, p_a + R_a @ ca.sparsify(a), i, common)
        R_b, p_b = self._carried(R_b, p_b + R_b @ ca.sparsify(b), j, common)
        return ca.sparsify(R_b.T @ R_a), ca.sparsify(R_b.T @ (p_a - p_b))

    def _attached(self, name: str) -> tuple[int, ca.SX, ca.SX]:
        """Link that carries a frame (-1: the ground), and the frame's placement in it."""
        if name == WORLD:
            return -1, sparse(np.eye(3)), ca.SX(3, 1)
        bodies: pin.Model = self._model.pin
        frame = bodies.frames[bodies.getFrameId(name)]
        R, p = frame.placement.rotation, frame.placement.translation
        if frame.parentJoint == 0:
            return -1, sparse(R), sparse(p)
        T, _ = turn_of(bodies, frame.parentJoint)
        return frame.parentJoint - 1, sparse(T.T @ R), sparse(T.T @ p)

    def _carried(self, R: ca.SX, p: ca.SX, link: int, ancestor: int) -> tuple[ca.SX, ca.SX]:
        while link != ancestor:
            pose: Rotation = self._pose[link]
            R, p = ca.sparsify(pose.R @ R), ca.sparsify(pose.R @ p + pose.p)
            link = self._tree.links[link].parent
        return R, p


def _common(tree: Tree, i: int, j: int) -> int:
    """The nearest link that carries both, -1 for the ground; parents come first in a tree."""
    while i != j:
        if i > j:
            i = tree.links[i].parent
        else:
            j = tree.links[j].parent
    return i


def _residual(constraint: Bilateral, model: ArmModel, kinematics: Kinematics, q: ca.SX) -> ca.SX:
    if isinstance(constraint, CouplingConstraint):
        first, second = (q[model.joint_names.index(name)] for name in constraint.joints)
        return first - constraint.ratio * second - constraint.offset
    R, u = kinematics.relative(constraint)
    if isinstance(constraint, PointConstraint):
        return u
    if isinstance(constraint, FrameConstraint):
        return ca.vertcat(u, _turned(R, constraint.rpy))
    if isinstance(constraint, LineConstraint):
        return sparse(across(constraint.direction)) @ u
    if isinstance(constraint, PlaneConstraint):
        return sparse(np.array([constraint.normal])) @ u - constraint.height
    assert isinstance(constraint, DistanceConstraint)
    length = constraint.distance
    return (ca.sumsqr(u) - length**2) / (2 * length)


def _turned(R: ca.SX, rpy: Sequence[float]) -> ca.SX:
    """How far R is from roll, pitch, yaw: 2 sin(θ/2) along the axis, in the second frame.

    It grows with the angle up to half a turn, so Newton's method goes the short way.
    """
    wanted = sparse(pin.rpy.rpyToMatrix(*rpy))
    E = wanted.T @ R
    axis = ca.vertcat(E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1])
    return ca.sparsify(wanted @ axis / ca.sqrt(ca.fmax(1 + ca.trace(E), HALF_TURN)))


def _slip(constraint: RollingConstraint, kinematics: Kinematics, q: ca.SX, v: ca.SX) -> ca.SX:
    """Velocity along the plane of the material point that touches it in [m/s], shape (2,)."""
    R, u = kinematics.relative(constraint)
    R_dot, u_dot = ca.reshape(ca.jtimes(ca.vec(ca.densify(R)), q, v), 3, 3), ca.jtimes(u, q, v)
    spin = R_dot @ R.T
    omega = ca.sparsify(ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0]))
    normal = sparse(np.array(constraint.normal))
    down = -normal
    if constraint.axle is not None:
        axle = R @ sparse(np.array(constraint.axle))
        steepest = ca.dot(normal, axle) * axle - normal
        down = steepest / ca.sqrt(ca.fmax(ca.sumsqr(steepest), HALF_TURN))
    touching = u_dot + constraint.radius * cross(omega, down)
    return sparse(across(constraint.normal)) @ touching


def across(direction: Sequence[float]) -> np.ndarray:
    """Two unit vectors that complete a direction to a right-handed triad, shape (2, 3)."""
    z = np.array(direction)
    x = np.roll(np.eye(3)[np.argmax(abs(z))], 1)
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x)])
