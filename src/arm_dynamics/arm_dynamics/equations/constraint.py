# SPDX-License-Identifier: Apache-2.0
"""Bilateral constraints on positions, velocities and accelerations.

A constraint is written once, as a position residual φ(q), or, if nonholonomic (rolling), as a
speed w(q, v) that is linear in v. From it follow, by exact differentiation,

    A(q) v = φ̇ = w = 0          and          A(q) a + γ(q, v) = 0,  γ = Ȧ v.

Sign of the multipliers, here and everywhere: τ = M a + h + Aᵀλ, so λ is what the robot exerts *on*
the constraint: the force of the first frame on the second, in axes of the second.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch

import casadi as ca
import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.equations.frame import Frame, relative
from arm_dynamics.equations.rigid_body import placements
from arm_dynamics.equations.tree import Tree, cross, sparse
from arm_dynamics.scene import constraint as kinds

# Below this, 1 + trace of a rotation is treated as half a revolution, where the axis is
# undetermined.
HALF_TURN = 1e-9


@dataclass(frozen=True)
class Linkage:
    """Constraints between the links of a tree, and between links and the ground.

    Attributes:
        constraints: Bilateral constraints by their indices in the scene's list.
        frames: The frames that they refer to.
        joint_names: Independent joints, in the order of q.
        kept: Independent rows of each constraint, which imply all others, by its index.
    """

    constraints: Mapping[int, kinds.Bilateral]
    frames: Mapping[str, Frame]
    joint_names: Sequence[str]
    kept: Mapping[int, Sequence[int]]


@dataclass(frozen=True)
class Rows:
    """Constraint equations of a scene; those with a position residual come first.

    Attributes:
        all_residuals: φ of all constraints in [m] and [rad], to check whether they are satisfied.
        residual: φ of the first h independent rows, shape (h,); the others are nonholonomic.
        jacobian: A, shape (m, n).
        drift: γ = Ȧ v, shape (m,).
    """

    all_residuals: ca.SX
    residual: ca.SX
    jacobian: ca.SX
    drift: ca.SX


def rows(
    linkage: Linkage, tree: Tree, q: ca.SX, v: ca.SX, active: Callable[[int], ca.SX | float]
) -> Rows:
    """Equations of all constraints.

    Args:
        linkage: The constraints.
        tree: The links.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        active: 1 or 0 for the constraint at each index of the scene's list; rows of an inactive
            one vanish.

    Returns:
        The independent rows in the order of the scene, rolling constraints last.
    """
    kinematics = Kinematics(linkage, tree, q, v)
    all_residuals, holonomic, rolling = list[ca.SX](), list[ca.SX](), list[ca.SX]()
    for i, constraint in linkage.constraints.items():
        kept = list(linkage.kept[i])
        if isinstance(constraint, kinds.RollingConstraint):
            rolling.append(active(i) * _slip(constraint, kinematics)[kept])
        else:
            phi = active(i) * _residual(constraint, kinematics)
            all_residuals.append(phi)
            holonomic.append(phi[kept])
    residual = ca.sparsify(ca.vertcat(ca.SX(0, 1), *holonomic))
    slip = ca.vertcat(ca.SX(0, 1), *rolling)
    speed = ca.vertcat(ca.jtimes(residual, q, v), slip)
    J = ca.vertcat(ca.jacobian(residual, q), ca.jacobian(slip, v))
    every = ca.vertcat(ca.SX(0, 1), *all_residuals)
    return Rows(every, residual, ca.sparsify(J), ca.jtimes(speed, q, v))


class Kinematics:
    """Positions of joints, and relative placements of frames, as expressions."""

    def __init__(self, linkage: Linkage, tree: Tree, q: ca.SX, v: ca.SX) -> None:
        self.q, self.v = q, v
        self._linkage, self._tree, self._pose = linkage, tree, placements(tree, q)

    def joint(self, name: str) -> ca.SX:
        """Position of a joint in [rad] or [m]."""
        return self.q[self._linkage.joint_names.index(name)]

    def relative(self, constraint: kinds.FrameBased) -> tuple[ca.SX, ca.SX]:
        """Rotation of the first frame in the second; the first point relative to the second."""
        frames = [self._linkage.frames[name] for name in constraint.frames]
        return relative(self._tree, self._pose, frames, constraint.points)


@singledispatch
def _residual(constraint: object, kinematics: Kinematics) -> ca.SX:
    """φ of one constraint, by its type."""
    raise NotImplementedError(type(constraint).__name__)


@_residual.register
def _(constraint: kinds.CouplingConstraint, kinematics: Kinematics) -> ca.SX:
    first, second = map(kinematics.joint, constraint.joints)
    return first - constraint.ratio * second - constraint.offset


@_residual.register
def _(constraint: kinds.PointConstraint, kinematics: Kinematics) -> ca.SX:
    return kinematics.relative(constraint)[1]


@_residual.register
def _(constraint: kinds.FrameConstraint, kinematics: Kinematics) -> ca.SX:
    R, u = kinematics.relative(constraint)
    return ca.vertcat(u, _rotation_error(R, constraint.rpy))


@_residual.register
def _(constraint: kinds.LineConstraint, kinematics: Kinematics) -> ca.SX:
    return sparse(across(constraint.direction)) @ kinematics.relative(constraint)[1]


@_residual.register
def _(constraint: kinds.PlaneConstraint, kinematics: Kinematics) -> ca.SX:
    normal = sparse(np.array([constraint.normal]))
    return normal @ kinematics.relative(constraint)[1] - constraint.height


@_residual.register
def _(constraint: kinds.DistanceConstraint, kinematics: Kinematics) -> ca.SX:
    u, length = kinematics.relative(constraint)[1], constraint.distance
    return (ca.sumsqr(u) - length**2) / (2 * length)


def _rotation_error(R: ca.SX, rpy: Sequence[float]) -> ca.SX:
    """Rotation error of R from roll, pitch, yaw: 2 sin(θ/2) along the axis, in the second frame.

    It grows with the angle up to half a revolution, so Newton's method takes the short way.
    """
    target = sparse(pin.rpy.rpyToMatrix(*rpy))
    E = target.T @ R
    axis = ca.vertcat(E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1])
    return ca.sparsify(target @ axis / ca.sqrt(ca.fmax(1 + ca.trace(E), HALF_TURN)))


def _slip(constraint: kinds.RollingConstraint, kinematics: Kinematics) -> ca.SX:
    """Tangential velocity of the material contact point in [m/s], shape (2,)."""
    q, v = kinematics.q, kinematics.v
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
    contact_velocity = u_dot + constraint.radius * cross(omega, down)
    return sparse(across(constraint.normal)) @ contact_velocity


def across(direction: Sequence[float] | Array) -> Array:
    """Two unit vectors that complete a direction to a right-handed triad, shape (2, 3)."""
    z = np.array(direction)
    # x starts from the basis vector after the largest entry, such that a coordinate axis gives a
    # cyclic permutation of the axes.
    x = np.roll(np.eye(3)[np.argmax(abs(z))], 1)
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(z, x)])
