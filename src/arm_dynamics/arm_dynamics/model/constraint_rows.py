# SPDX-License-Identifier: Apache-2.0
"""Constraint rows at one state, by Pinocchio: residual φ, A and γ = Ȧ v.

The same rows in the same order as the expressions of ``equations.constraint``, derived
independently from velocities and accelerations of the frames relative to the second frame of a
constraint (relative kinematics: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2).
"""

from collections.abc import Collection
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.equations.constraint import across
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.robot import Robot
from arm_dynamics.scene import constraint as kinds

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True)
class Row:
    """Rows of one constraint at a state.

    Attributes:
        residual: φ in [m] or [rad], shape (k,); zeros for rolling.
        jacobian: A, shape (k, n).
        drift: γ = Ȧ v, shape (k,).
    """

    residual: Array
    jacobian: Array
    drift: Array


@dataclass(frozen=True)
class _Derivatives:
    """Motion of a point or an orientation: value, Jacobian J, rate J v, and drift J̇ v.

    In [m] or [rad], per [s] and [s²]; shapes (3,), (3, n), (3,) and (3,).
    """

    value: Array
    J: Array
    rate: Array
    drift: Array


class ConstraintRows:
    """Rows of all bilateral constraints of a robot, in the order of the scene.

    Args:
        robot: The robot; used from one thread only.

    Attributes:
        joint_names: Order of every vector.
        constraints: Bilateral constraints of the scene.
        names: Name of each constraint.
        places: Index of each in the scene's list.
        counts: Number of rows of each.

    Raises:
        SceneError: If a constraint connects two frames that cannot move relative to each other.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._data = robot, pin.Data(robot.pin)
        constraints = robot.scene.bilateral
        self.constraints, self.places = tuple(constraints.values()), tuple(constraints)
        self.names = tuple(kinds.label(constraint, i) for i, constraint in constraints.items())
        for name, constraint in zip(self.names, self.constraints, strict=True):
            if isinstance(constraint, kinds.CouplingConstraint):
                continue
            first, second = constraint.frames
            if robot.frame(first).parentJoint == robot.frame(second).parentJoint:
                raise SceneError(
                    f"scene: constraint '{name}' connects '{first}' to '{second}', which cannot "
                    "move relative to each other: no joint is between them, or all of them are "
                    "locked"
                )
        still = np.zeros(robot.n)
        self.joint_names = robot.joint_names
        self.counts = tuple(len(row.residual) for row in self.at(still, still))

    def at(self, q: Array, v: Array) -> list[Row]:
        """Rows of each constraint at positions and velocities of shape (n,)."""
        model, data = self._robot, self._data
        full = model.expanded(q, v)
        pin.forwardKinematics(model.pin, data, *full, np.zeros(model.pin.nv))
        pin.computeJointJacobians(model.pin, data, full[0])
        pin.updateFramePlacements(model.pin, data)
        return [_row(constraint, self, q) for constraint in self.constraints]

    def stacked(self, q: Array, v: Array, names: Collection[str]) -> Row:
        """Rows of the named constraints, stacked in the order of the scene."""
        pairs = zip(self.names, self.at(q, v), strict=True)
        rows = [row for name, row in pairs if name in names]
        return Row(
            np.concatenate([np.zeros(0), *(row.residual for row in rows)]),
            np.vstack([np.zeros((0, len(q))), *(row.jacobian for row in rows)]),
            np.concatenate([np.zeros(0), *(row.drift for row in rows)]),
        )

    def relative(self, constraint: kinds.FrameBased) -> tuple[_Derivatives, _Derivatives, Array]:
        """First point and rotation of the first frame relative to the second, and their R."""
        a, b = (self._frame(*x) for x in zip(constraint.frames, constraint.points, strict=True))
        (p, spin, R_a), (p_b, spin_b, R_b) = a, b
        d, d_dot, omega, alpha = p.value - p_b.value, p.rate - p_b.rate, spin_b.rate, spin_b.drift
        drift = p.drift - p_b.drift - _cross(alpha, d) - 2 * _cross(omega, d_dot)
        u = _Derivatives(
            R_b.T @ d,
            R_b.T @ (p.J - p_b.J + pin.skew(d) @ spin_b.J),
            R_b.T @ (d_dot - _cross(omega, d)),
            R_b.T @ (drift + _cross(omega, _cross(omega, d))),
        )
        w = spin.rate - omega
        turn = _Derivatives(
            np.zeros(3),
            R_b.T @ (spin.J - spin_b.J),
            R_b.T @ w,
            R_b.T @ (spin.drift - alpha - _cross(omega, w)),
        )
        return u, turn, R_b.T @ R_a

    def _frame(
        self, name: str, point: tuple[float, float, float]
    ) -> tuple[_Derivatives, _Derivatives, Array]:
        """A point of a frame and the frame's angular velocity, in world axes, and its rotation."""
        model, data = self._robot, self._data
        index = model.frame_index(name)
        M, still = data.oMf[index], np.zeros(3)
        if model.pin.frames[index].parentJoint == 0:
            no_motion = np.zeros((3, model.n))
            place = _Derivatives(M.act(np.array(point)), no_motion, still, still)
            return place, _Derivatives(still, no_motion, still, still), M.rotation.copy()
        J = model.gather(pin.getFrameJacobian(model.pin, data, index, _ALIGNED).reshape(6, -1))
        v = pin.getFrameVelocity(model.pin, data, index, _ALIGNED)
        a = pin.getFrameClassicalAcceleration(model.pin, data, index, _ALIGNED)
        r = M.rotation @ np.array(point)
        w, alpha = v.angular.copy(), a.angular.copy()
        point_motion = _Derivatives(
            M.translation + r,
            J[:3] - pin.skew(r) @ J[3:],
            v.linear + _cross(w, r),
            a.linear + _cross(alpha, r) + _cross(w, _cross(w, r)),
        )
        return point_motion, _Derivatives(still, J[3:], w, alpha), M.rotation.copy()


def _cross(a: Array, b: Array) -> Array:
    """Cross product of two vectors; NumPy's takes ten times as long for these."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


@singledispatch
def _row(constraint: object, rows: ConstraintRows, q: Array) -> Row:
    """Rows of one constraint at positions q, shape (n,), by its type."""
    raise NotImplementedError(type(constraint).__name__)


@_row.register
def _(constraint: kinds.CouplingConstraint, rows: ConstraintRows, q: Array) -> Row:
    A = np.zeros((1, len(q)))
    i, j = map(rows.joint_names.index, constraint.joints)
    A[0, i], A[0, j] = 1.0, -constraint.ratio
    return Row(A @ q - constraint.offset, A, np.zeros(1))


@_row.register
def _(constraint: kinds.PointConstraint, rows: ConstraintRows, q: Array) -> Row:
    u, _, _ = rows.relative(constraint)
    return Row(u.value, u.J, u.drift)


@_row.register
def _(constraint: kinds.FrameConstraint, rows: ConstraintRows, q: Array) -> Row:
    u, turn, R = rows.relative(constraint)
    w = _rotation_error(R, turn, pin.rpy.rpyToMatrix(*constraint.rpy))
    return Row(np.r_[u.value, w.value], np.vstack([u.J, w.J]), np.r_[u.drift, w.drift])


@_row.register
def _(constraint: kinds.LineConstraint, rows: ConstraintRows, q: Array) -> Row:
    u, T = rows.relative(constraint)[0], across(constraint.direction)
    return Row(T @ u.value, T @ u.J, T @ u.drift)


@_row.register
def _(constraint: kinds.PlaneConstraint, rows: ConstraintRows, q: Array) -> Row:
    u, T = rows.relative(constraint)[0], np.array([constraint.normal])
    return Row(T @ u.value - constraint.height, T @ u.J, T @ u.drift)


@_row.register
def _(constraint: kinds.DistanceConstraint, rows: ConstraintRows, q: Array) -> Row:
    u, length = rows.relative(constraint)[0], constraint.distance
    residual = (u.value @ u.value - length**2) / (2 * length)
    drift = (u.value @ u.drift + u.rate @ u.rate) / length
    return Row(np.array([residual]), (u.value @ u.J / length)[None], np.array([drift]))


@_row.register
def _(constraint: kinds.RollingConstraint, rows: ConstraintRows, q: Array) -> Row:
    u, turn, R = rows.relative(constraint)
    n, w = np.array(constraint.normal), turn.rate
    down, down_rate = -n, np.zeros(3)
    if constraint.axle is not None:
        e = R @ np.array(constraint.axle)
        e_rate = _cross(w, e)
        s, s_rate = (n @ e) * e - n, (n @ e_rate) * e + (n @ e) * e_rate
        size = max(float(np.linalg.norm(s)), 1e-9)
        down = s / size
        down_rate = (s_rate - down * (down @ s_rate)) / size
    T, r = across(constraint.normal), constraint.radius
    drift = u.drift + r * (_cross(turn.drift, down) + _cross(w, down_rate))
    return Row(np.zeros(2), T @ (u.J - r * pin.skew(down) @ turn.J), T @ drift)


def _rotation_error(R: Array, turn: _Derivatives, target: Array) -> _Derivatives:
    """2 sin(θ/2) along the axis, in the second frame: twice the quaternion's vector part."""
    quaternion = pin.Quaternion(target.T @ R).coeffs()
    x = 2 * np.copysign(1.0, quaternion[3]) * target @ quaternion[:3]
    w = max(abs(quaternion[3]), 1e-9)
    G = w * np.eye(3) - pin.skew(x) / 2
    rate = G @ turn.rate
    G_dot = -(x @ rate) / (4 * w) * np.eye(3) - pin.skew(rate) / 2
    return _Derivatives(x, G @ turn.J, rate, G @ turn.drift + G_dot @ turn.rate)
