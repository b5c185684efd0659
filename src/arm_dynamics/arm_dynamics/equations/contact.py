# SPDX-License-Identifier: Apache-2.0
"""Contact of points and balls with planes: gaps, and the forces of closed contacts.

A closed contact is a constraint, gap acceleration zero, with the normal force as its reaction; one
that sticks adds two tangential constraints, and one that slides transmits the force µ f_n opposite
to its direction (Glocker, Set-Valued Force Laws, 2001, chapters 5 and 6; Pfeiffer and Glocker,
Multibody Dynamics with Unilateral Contacts, 1996, chapter 5). The mode of each contact is an
input, so the expressions have no branches. Forces and speeds of a contact are ordered normal,
first and second tangent.

A plane is fixed to a link or to the ground, and all quantities are expressed in its axes: with u
the centre of the ball (a point is a ball of radius zero), n the normal and ω the angular velocity
of the ball relative to the plane, the gap is nᵀu - r with the radius r, and the relative velocity
of the material contact points, the ball's at -r n, is u̇ - r ω x n. If r > 0, only its normal part
is the rate of a position: rolling is nonholonomic (Neimark and Fufaev, Dynamics of Nonholonomic
Systems, 1972, chapter I).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.factorizations import lu
from arm_dynamics.equations.rigid_body import Placement, placements
from arm_dynamics.equations.tree import (
    Tree,
    common_link,
    links_between,
    skew,
    sparse,
    spread_map,
    symmetric,
)

# Entries of p for each contact: closed, sticks, direction in which it slides (two tangents), and
# whether it keeps that direction.
MODE = 5
# Redundant contacts make the equations of the forces singular. A small multiple of their trace on
# the diagonal and two refinements give the solution of least norm, exact to rounding if it is
# unique (proximal point iteration: Rockafellar, SIAM J. Control Optim. 14, 1976).
DAMPING, REFINEMENTS = 1e-8, 2
# Of a row, not more than this multiple of its own mobility, whose effect the refinements remove as
# well: that of a light body does not soften the contacts of a heavy one beside it.
OWN_DAMPING = 1e-5
# A row whose mobility is below this fraction of the trace cannot move: it is rounding.
LEAST_MOBILITY = 1e-20
# Number of rows above which forces are computed by a matrix of the size of M, if that is smaller,
# and the multiple used there: forces of eight contacts are a thousand times closer to least norm.
ROW_LIMIT, MOTION_DAMPING = 9, 1e-10
# Tangential speed in [m/s] below which a contact is at rest: its direction is rounding.
AT_REST = 1e-9


@dataclass(frozen=True)
class ContactPoint:
    """Parameters of one contact.

    Attributes:
        name: Its name in messages.
        link: Index of the link that carries the point, -1 for the ground.
        place: The point, or the ball's centre, in the link's frame in [m], shape (3,).
        radius: Radius of the ball in [m], 0 for a point.
        carrier: Index of the link that carries the plane, -1 for the ground.
        axes: Rows: normal and two tangents of the plane in its carrier's frame, shape (3, 3).
        offset: The plane's distance from its carrier's origin along the normal in [m].
        friction: Coulomb coefficient of sliding friction.
        static_friction: Coefficient of static friction.
        restitution: Newton's coefficient of restitution.
    """

    name: str
    link: int
    place: Array
    radius: float
    carrier: int
    axes: Array
    offset: float
    friction: float
    static_friction: float
    restitution: float


@dataclass(frozen=True)
class Geometry:
    """Kinematics of the contact points.

    Attributes:
        place: Coordinates in the plane's axes, the gap first, in [m], shape (3 nc,).
        size: Sum of the lengths that add up to a gap, a measure of its rounding, in [m], shape
            (nc,).
        rows: A, where A v is the relative velocity of the material contact points, shape (3 nc,
            n).
    """

    place: ca.SX
    size: ca.SX
    rows: ca.SX


@dataclass(frozen=True)
class Mode:
    """Mode of each contact.

    Attributes:
        closed: 1 if it is closed, 0 if it is open, shape (nc,).
        sticks: 1 if a closed one sticks, 0 if it slides, shape (nc,).
        direction: Sliding direction in the two tangents, shape (2 nc,).
        fixed: 1 if it keeps that direction, 0 if the direction follows the motion, shape (nc,).
    """

    closed: ca.SX
    sticks: ca.SX
    direction: ca.SX
    fixed: ca.SX

    @classmethod
    def of(cls, p: ca.SX) -> Mode:
        """From the modes' entries in p, shape (5 nc,)."""
        table = ca.reshape(p, MODE, p.shape[0] // MODE)
        return cls(table[0, :].T, table[1, :].T, ca.vec(table[2:4, :]), table[4, :].T)

    def rows(self) -> ca.SX:
        """1 for each of the 3 nc equations that is active, else 0."""
        sticking = self.closed * self.sticks
        return ca.vec(ca.vertcat(self.closed.T, sticking.T, sticking.T))


def geometry(tree: Tree, points: list[ContactPoint], q: ca.SX) -> Geometry:
    """Kinematics of the contact points at joint positions ``q`` of shape (n,)."""
    pose, places, sizes = placements(tree, q), [], []
    for point in points:
        at, size = _centre(tree, pose, point)
        height = ca.vertcat(ca.SX(point.offset + point.radius), 0, 0)
        places.append(sparse(point.axes) @ at - ca.sparsify(height))
        sizes.append(size + np.abs(point.place).sum() + abs(point.offset) + point.radius)
    place = ca.densify(ca.vertcat(*places))
    turning = ca.vertcat(*[_turning_speeds(tree, pose, point) for point in points])
    return Geometry(place, ca.densify(ca.vertcat(*sizes)), ca.jacobian(place, q) + turning)


def positional(points: list[ContactPoint]) -> ca.DM:
    """1 for each of the 3 nc speeds that is the rate of a position, 0 for tangents of balls."""
    return ca.vertcat(*[ca.DM([1, point.radius == 0, point.radius == 0]) for point in points])


def sites(tree: Tree, points: list[ContactPoint], q: ca.SX) -> ca.SX:
    """Contact frames in the world.

    Args:
        tree: The links.
        points: The contacts.
        q: Joint positions, shape (n,).

    Returns:
        For each contact, in columns: normal, both tangents, and the position of the material
        contact point in [m], shape (3, 4 nc).
    """
    pose, columns = placements(tree, q), []
    for point in points:
        axes = sparse(point.axes).T
        at = _centre(tree, pose, point)[0] - point.radius * axes[:, 0]
        for i in links_between(tree, point.carrier, -1):
            axes, at = pose[i].R @ axes, pose[i].R @ at + pose[i].p
        columns.append(ca.horzcat(axes, at))
    return ca.densify(ca.horzcat(*columns))


def _chains(tree: Tree, point: ContactPoint) -> tuple[list[int], list[int]]:
    """Links that move the point, and those that move the plane, relative to their common link."""
    common = common_link(tree, point.link, point.carrier)
    return (links_between(tree, point.link, common), links_between(tree, point.carrier, common))


def _centre(tree: Tree, pose: list[Placement], point: ContactPoint) -> tuple[ca.SX, ca.SX]:
    """The point in the frame of its plane's link, and the sum of the lengths to it in [m]."""
    of_point, of_plane = _chains(tree, point)
    at, size = sparse(point.place), ca.SX(0)
    for i in of_point:
        at = pose[i].R @ at + pose[i].p
        size += ca.norm_1(pose[i].p)
    for i in reversed(of_plane):
        at = pose[i].R.T @ (at - pose[i].p)
        size += ca.norm_1(pose[i].p)
    return at, size


def _turning_speeds(tree: Tree, pose: list[Placement], point: ContactPoint) -> ca.SX:
    """Rows of -r ω x n, which the rotation of a ball adds to u̇, shape (3, n)."""
    if point.radius == 0:
        return ca.SX(3, tree.followers.shape[1])
    turning, R = ca.SX(3, len(tree.links)), ca.SX.eye(3)
    of_point, of_plane = _chains(tree, point)
    for i in of_plane:
        if not tree.links[i].prismatic:
            turning[:, i] = -R[:, 2]
        R = ca.sparsify(R @ pose[i].R.T)
    for i in reversed(of_point):
        R = ca.sparsify(R @ pose[i].R)
        if not tree.links[i].prismatic:
            turning[:, i] = R[:, 2]
    across = sparse(point.axes) @ skew(sparse(point.axes[0]))
    return ca.sparsify(point.radius * across @ ca.sparsify(turning) @ spread_map(tree))


def sliding_direction(speed: ca.SX, initial: ca.SX, fixed: ca.SX) -> ca.SX:
    """Unit vector of the sliding direction, continued through rest.

    A contact that comes to rest and would reverse keeps its direction until the event is located.

    Args:
        speed: Tangential velocity in [m/s], shape (2,).
        initial: Direction at the beginning of the motion, a unit vector, shape (2,).
        fixed: 1 to keep it.

    Returns:
        Shape (2,).
    """
    square = ca.sumsqr(speed)
    resting = ca.logic_or(fixed > 0, square <= AT_REST**2)
    forward = ca.if_else(ca.dot(speed, initial) < 0, -1, 1)
    return ca.if_else(resting, initial, forward * speed / ca.sqrt(ca.if_else(resting, 1, square)))


def shares(points: list[ContactPoint], speed: ca.SX, mode: Mode) -> ca.SX:
    """Matrix D that maps the unknown forces to all forces, shape (3 nc, 3 nc).

    The tangential force of a sliding contact is -µ times its direction times the normal force.
    """
    D = ca.SX(3 * len(points), 3 * len(points))
    for k, point in enumerate(points):
        along = slice(3 * k + 1, 3 * k + 3)
        d = sliding_direction(speed[along], mode.direction[2 * k : 2 * k + 2], mode.fixed[k])
        D[3 * k, 3 * k] = mode.closed[k]
        D[along, 3 * k] = -point.friction * mode.closed[k] * (1 - mode.sticks[k]) * d
        D[along, along] = mode.closed[k] * mode.sticks[k] * ca.SX.eye(2)
    return ca.sparsify(D)


class Delassus:
    """Mobility of the contacts: accelerations under contact forces; the Delassus matrix.

    Args:
        A: Rows, shape (m, n).
        B: Accelerations of the joints per force, M⁻¹ Aᵀ, shape (n, m).

    Attributes:
        B: Accelerations of the joints per force, as given.
        W: Acceleration of the contacts per force on them, A M⁻¹ Aᵀ, in [1/kg], shape (m, m).
    """

    def __init__(self, A: ca.SX, B: ca.SX) -> None:
        self._many = A.shape[0] > max(ROW_LIMIT, A.shape[1])
        self._A, self.B, self.W = A, B, symmetric(A @ B) if self._many else A @ B
        self._scale = _scales(ca.sparsify(self.W))

    def accelerations(self, force: ca.SX) -> ca.SX:
        """Accelerations of the contacts in [m/s²] under forces on them in [N], shapes (m,)."""
        return self._A @ (self.B @ force) if self._many else self.W @ force

    def forces(self, free: ca.SX, D: ca.SX, rows: ca.SX) -> ca.SX:
        """Contact forces that make the accelerations of the chosen rows zero.

        Args:
            free: Accelerations of the contacts without contact forces in [m/s²], shape (m,).
            D: See ``shares``.
            rows: 1 for an active row, else 0, shape (m,).

        Returns:
            Forces in [N], shape (m,).
        """
        return D @ self._unknown(-rows * free, D, rows)

    def unknowns(self, D: ca.SX, rows: ca.SX) -> ca.SX:
        """Unknown forces per acceleration of active rows in [kg], shape (m, m); see ``forces``."""
        required = ca.SX.sym("required", rows.shape[0])
        return ca.jacobian(self._unknown(required, D, rows), required) @ ca.diag(rows)

    def _unknown(self, required: ca.SX, D: ca.SX, rows: ca.SX) -> ca.SX:
        """Unknown forces for required accelerations of active rows, by the smaller matrix."""
        if self._many:
            return self._of_motions(required, self.B @ D, ca.diag(rows) @ self._A)
        return self._of_rows(required, D, rows)

    def _of_rows(self, required: ca.SX, D: ca.SX, rows: ca.SX) -> ca.SX:
        """Solution y of R W D y = ``required`` by a matrix of the size of W."""
        R = ca.diag(rows)
        K = R @ self.W @ D
        unused = ca.diag(1 - rows)
        damping = ca.diag(DAMPING * self._scale + 1e-30)  # not zero where all contacts are open
        factors = lu.factorize(K + damping @ R + unused)
        y = lu.solve(factors, required)
        for _ in range(REFINEMENTS):
            y = y + lu.solve(factors, required - (K + unused) @ y)
        return y

    def _of_motions(self, required: ca.SX, Y: ca.SX, X: ca.SX) -> ca.SX:
        """Unknown forces by a matrix of the size of M.

        In its range, K = X Y has the inverse X (Y X)⁻² Y.

        (X Y + ε)⁻¹ X = X (Y X + ε)⁻¹, as multiplying out shows (Henderson and Searle, "On deriving
        the inverse of a sum of matrices", SIAM Review 23, 1981). Rows are scaled such that one ε
        suits all of them.
        """
        trace = ca.sum1(ca.diag(self.W)) + 1e-200
        root = ca.sqrt(trace / (self._scale + 1e-200))
        X, Y, required = ca.diag(root) @ X, Y @ ca.diag(root), root * required
        factors = lu.factorize(Y @ X + (MOTION_DAMPING * trace + 1e-30) * ca.SX.eye(X.shape[1]))
        y = ca.SX(required.shape[0], 1)
        for _ in range(1 + REFINEMENTS):
            motion = lu.solve(factors, Y @ (required - X @ (Y @ y)))
            y = y + X @ lu.solve(factors, motion)
        return root * y


def _scales(W: ca.SX) -> ca.SX:
    """What the damping of each row is a multiple of, in [1/kg], shape (m,).

    It is the trace of the rows that W couples with it, such that their forces are of least norm
    whatever else touches in the scene, or less for a row of little mobility among them.
    """
    mobility = ca.densify(ca.diag(W))
    total = ca.sum1(mobility)
    trace = ca.SX(_coupled(W)) @ mobility
    trace = ca.if_else(trace > LEAST_MOBILITY * total, trace, total)
    own = ca.if_else(mobility > LEAST_MOBILITY * total, mobility, trace)
    return ca.fmin(trace, OWN_DAMPING / DAMPING * own)


def _coupled(W: ca.SX) -> Array:
    """1 where rows are coupled, if only by way of others, else 0, shape (m, m)."""
    reach: Array = np.eye(W.shape[0]) + np.array(ca.DM(W.sparsity(), 1.0))
    for _ in range(W.shape[0].bit_length()):
        reach = np.minimum(reach @ reach, 1.0)
    return reach


def grips(points: list[ContactPoint], W: ca.SX, speed: ca.SX, mode: Mode) -> ca.SX:
    """Acceleration of each gap per normal force of its own contact in [1/kg], shape (nc,).

    Where it is not positive for a sliding contact, friction closes the contact faster than the
    normal force opens it, and the motion is undetermined (Painlevé 1895).
    """
    D = shares(points, speed, mode)
    own = [W[3 * k, 3 * k : 3 * k + 3] @ D[3 * k : 3 * k + 3, 3 * k] for k in range(len(points))]
    return ca.vertcat(*own)
