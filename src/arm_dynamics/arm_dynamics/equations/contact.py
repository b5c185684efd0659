# SPDX-License-Identifier: Apache-2.0
"""Contact of points of the arm with planes: gaps, and the forces of closed contacts.

A closed contact is a constraint, gap acceleration zero, with the normal force as its reaction; one
that sticks adds two tangential constraints, and one that slides bears the force µ λ against its
direction (Glocker, Set-Valued Force Laws, 2001, chapters 5 and 6; Pfeiffer and Glocker, Multibody
Dynamics with Unilateral Contacts, 1996, chapter 5). Which contact does what is an input, so that
the expressions have no branches. Forces and speeds of a contact stand in the order normal, first
and second tangent.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.rigid_body import placements, solve
from arm_dynamics.equations.tree import Tree, sparse

# Entries of p for each contact: closed, sticks, direction in which it slides (two tangents), and
# whether it keeps that direction.
MODE = 5
# Redundant contacts make the equations of the forces singular. A small multiple of their trace on
# the diagonal and two refinements give the solution of least norm, to rounding where there is but
# one (proximal point iteration: Rockafellar, SIAM J. Control Optim. 14, 1976).
DAMPING, REFINEMENTS = 1e-8, 2
# Tangential speed in [m/s] up to which a contact rests: its direction is rounding.
AT_REST = 1e-9


@dataclass(frozen=True)
class ContactPoint:
    """One contact, ready for the laws.

    Attributes:
        name: What messages call it.
        link: Index of the link that carries the point.
        place: The point in the link's frame in [m], shape (3,).
        axes: Rows: normal and two tangents of the plane in the world frame, shape (3, 3).
        offset: The plane's distance from the world's origin along the normal in [m].
        friction: Coulomb's coefficient of sliding.
        static_friction: The one up to which it sticks.
        restitution: Newton's coefficient.
    """

    name: str
    link: int
    place: Array
    axes: Array
    offset: float
    friction: float
    static_friction: float
    restitution: float


@dataclass(frozen=True)
class Geometry:
    """Where the contact points are.

    Attributes:
        place: Coordinates in the plane's axes, the first being the gap, in [m], shape (3 nc,).
        size: Sum of the lengths that make up a gap, a measure of its rounding, in [m], (nc,).
    """

    place: ca.SX
    size: ca.SX


@dataclass(frozen=True)
class Mode:
    """What each contact does.

    Attributes:
        closed: 1 if it carries, 0 if it is apart, shape (nc,).
        sticks: 1 if a closed one sticks, 0 if it slides, shape (nc,).
        direction: Of sliding in the two tangents, shape (2 nc,).
        fixed: 1 if it keeps that direction, 0 if it slides as it moves, shape (nc,).
    """

    closed: ca.SX
    sticks: ca.SX
    direction: ca.SX
    fixed: ca.SX

    @classmethod
    def of(cls, p: ca.SX) -> Mode:
        """From its entries in p, shape (5 nc,)."""
        table = ca.reshape(p, MODE, p.shape[0] // MODE)
        return cls(table[0, :].T, table[1, :].T, ca.vec(table[2:4, :]), table[4, :].T)

    def rows(self) -> ca.SX:
        """1 for each of the 3 nc equations that holds, else 0."""
        sticking = self.closed * self.sticks
        return ca.vec(ca.vertcat(self.closed.T, sticking.T, sticking.T))


def geometry(tree: Tree, points: list[ContactPoint], q: ca.SX) -> Geometry:
    """Places of the contact points for joint positions ``q`` of shape (n,)."""
    pose, places, sizes = placements(tree, q), [], []
    for point in points:
        at, i, size = sparse(point.place), point.link, ca.SX(0)
        while i >= 0:
            at = pose[i].R @ at + pose[i].p
            size += ca.norm_1(pose[i].p)
            i = tree.links[i].parent
        height = ca.vertcat(ca.SX(point.offset), 0, 0)
        places.append(sparse(point.axes) @ at - ca.sparsify(height))
        sizes.append(size + np.abs(point.place).sum() + abs(point.offset))
    return Geometry(ca.densify(ca.vertcat(*places)), ca.densify(ca.vertcat(*sizes)))


def sliding_direction(speed: ca.SX, given: ca.SX, fixed: ca.SX) -> ca.SX:
    """Unit vector of sliding, continued through rest.

    A contact that comes to rest and would turn back keeps its direction until the event is found.

    Args:
        speed: Tangential velocity in [m/s], shape (2,).
        given: Direction at the beginning of the motion, a unit vector, shape (2,).
        fixed: 1 to keep it.

    Returns:
        Shape (2,).
    """
    square = ca.sumsqr(speed)
    resting = ca.logic_or(fixed > 0, square <= AT_REST**2)
    forward = ca.if_else(ca.dot(speed, given) < 0, -1, 1)
    return ca.if_else(resting, given, forward * speed / ca.sqrt(ca.if_else(resting, 1, square)))


def shares(points: list[ContactPoint], speed: ca.SX, mode: Mode) -> ca.SX:
    """Matrix D that makes all forces from the unknown ones, shape (3 nc, 3 nc).

    The tangential force of a contact that slides is -µ times its direction times the normal one.
    """
    D = ca.SX(3 * len(points), 3 * len(points))
    for k, point in enumerate(points):
        along = slice(3 * k + 1, 3 * k + 3)
        d = sliding_direction(speed[along], mode.direction[2 * k : 2 * k + 2], mode.fixed[k])
        D[3 * k, 3 * k] = mode.closed[k]
        D[along, 3 * k] = -point.friction * mode.closed[k] * (1 - mode.sticks[k]) * d
        D[along, along] = mode.closed[k] * mode.sticks[k] * ca.SX.eye(2)
    return ca.sparsify(D)


def forces(W: ca.SX, free: ca.SX, D: ca.SX, rows: ca.SX) -> ca.SX:
    """Contact forces that make the accelerations of the chosen rows zero.

    Args:
        W: Acceleration of the contacts per force on them, A M⁻¹ Aᵀ, in [1/kg], shape (m, m).
        free: Their accelerations without contact forces in [m/s²], shape (m,).
        D: See ``shares``.
        rows: 1 for a row that holds, else 0, shape (m,).

    Returns:
        Forces in [N], shape (m,).
    """
    R = ca.diag(rows)
    K = R @ W @ D
    unused = ca.diag(1 - rows)
    damping = DAMPING * ca.trace(W) + 1e-30
    factors = lu(K + damping * R + unused)
    required = -rows * free
    y = lu_solve(factors, required)
    for _ in range(REFINEMENTS):
        y = y + lu_solve(factors, required - (K + unused) @ y)
    return D @ y


def grips(points: list[ContactPoint], W: ca.SX, speed: ca.SX, mode: Mode) -> ca.SX:
    """Acceleration of each gap per normal force of its own contact in [1/kg], shape (nc,).

    Where it is not positive for a contact that slides, friction presses the contact together
    faster than the normal force opens it, and the motion is not determined (Painlevé 1895).
    """
    D = shares(points, speed, mode)
    own = [W[3 * k, 3 * k : 3 * k + 3] @ D[3 * k : 3 * k + 3, 3 * k] for k in range(len(points))]
    return ca.vertcat(*own)


def solve_columns(M: ca.SX, B: ca.SX) -> ca.SX:
    """M⁻¹ B for symmetric positive definite M and several columns."""
    return ca.horzcat(*[solve(M, B[:, j]) for j in range(B.shape[1])])


def lu(A: ca.SX) -> ca.SX:
    """Both factors of A = L U in one matrix, without pivoting (L has ones on its diagonal)."""
    F = ca.SX(A)
    for k in range(F.shape[0]):
        for i in range(k + 1, F.shape[0]):
            F[i, k] = F[i, k] / F[k, k]
            F[i, k + 1 :] = F[i, k + 1 :] - F[i, k] * F[k, k + 1 :]
    return F


def lu_solve(F: ca.SX, b: ca.SX) -> ca.SX:
    """Solve L U x = b for the factors of ``lu``."""
    x = ca.densify(ca.SX(b))
    for i in range(F.shape[0]):
        for j in range(i):
            x[i] -= F[i, j] * x[j]
    for i in reversed(range(F.shape[0])):
        for j in range(i + 1, F.shape[0]):
            x[i] -= F[i, j] * x[j]
        x[i] = x[i] / F[i, i]
    return x
