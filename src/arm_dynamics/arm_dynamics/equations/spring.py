# SPDX-License-Identifier: Apache-2.0
"""Springs and dampers of joints, between points of two links, and of end stops.

S(q, v) is the torque that the drives must supply against the first two, M a + C v + G + S + F = τ.
A joint spring takes k (q - rest) + c v, or in place of k a torque tabulated by q - rest. A spring
between points pulls them together with the tension

    T = k (L - L₀) + c L̇ + T₀

along the line, hence S = T ∂L/∂q by virtual work. With u the vector from one point to the other,
∂L/∂q = ∂(u·u/2)/∂q / L and L̇ = u·u̇ / L, so only the tension per length T/L appears, the force
density of tensile structures (Schek, "The force density method for form finding and computation of
general networks", Comp. Methods Appl. Mech. Eng. 3, 1974). For L₀ = T₀ = 0, the springs of zero
free length that balance arms (Herder, Energy-free Systems, 2001), it is the constant k, and no
length is computed.

Where the points coincide, the line has no direction. The length is therefore taken as L² = u·u +
``NEAR`` ², in force and energy alike: the force passes through zero within a nanometre, there is
no division by zero, and energy is conserved.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.elementary import Quantity, choose, larger, root
from arm_dynamics.equations.frame import Frame, relative
from arm_dynamics.equations.interpolation import Curve
from arm_dynamics.equations.tree import Tree, constant, like, spread_map
from arm_dynamics.scene.spring import PointSpring

# Length in [m] below which a spring between points has no direction.
NEAR = 1e-9


@dataclass(frozen=True)
class Springs:
    """All springs of a tree.

    Attributes:
        stiffness: Stiffness at each link's joint in [N m/rad] or [N/m], shape (links,).
        rest: Rest position of each joint's spring in [rad] or [m], likewise.
        damping: Damping at each joint in [N m s/rad] or [N s/m], likewise.
        tables: Torque by deflection of each joint whose spring is not linear, else None.
        points: Springs between points.
        frames: The frames that they refer to.
    """

    stiffness: Array
    rest: Array
    damping: Array
    tables: tuple[Curve | None, ...]
    points: tuple[PointSpring, ...]
    frames: Mapping[str, Frame]

    def __bool__(self) -> bool:
        """Whether there is any spring."""
        return bool(self.points or self.of_joints.any())

    @property
    def of_joints(self) -> NDArray[np.bool_]:
        """Joints with a spring or a damper beside them, shape (links,)."""
        tabulated = np.array([table is not None for table in self.tables], dtype=bool)
        return tabulated | (self.stiffness + self.damping > 0.0)

    def pull(self, x: Quantity) -> Quantity:
        """Elastic torques of the joints' springs in [N m] or [N], shape (links,).

        Args:
            x: Their deflections in [rad] or [m], shape (links,), an array or an expression.
        """
        linear = like(x)(self.stiffness) * x
        return self._with_tables(linear, x, Curve.__call__)

    def stored(self, x: Quantity) -> Quantity:
        """Energies of the joints' springs in [J], shape (links,); see ``pull``."""
        linear = like(x)(self.stiffness) * x**2 / 2
        return self._with_tables(linear, x, lambda t, at: t.integral(at) - t.integral(0.0))

    def _with_tables(
        self, linear: Quantity, x: Quantity, value: Callable[[Curve, Quantity], Quantity]
    ) -> Quantity:
        if not any(self.tables):
            return linear
        items = enumerate(self.tables)
        torques = [linear[i] if t is None else value(t, x[i]) for i, t in items]
        return ca.vertcat(*torques) if isinstance(x, ca.SX) else np.array(torques)


def tension(spring: PointSpring, square: Quantity, rate: Quantity) -> tuple[Quantity, Quantity]:
    """Tension per length of a spring between points, elastic and of its damper, in [N/m].

    A cord can only pull: when slack, where the elastic part would push, spring and damper have no
    effect; when taut, the damper cancels at most the elastic part.

    Args:
        spring: The spring.
        square: u·u in [m²].
        rate: u·u̇ in [m²/s].
    """
    L2 = square + NEAR**2
    preload = spring.force - spring.stiffness * spring.rest_length
    elastic = spring.stiffness + preload / root(L2)
    damping = spring.damping * rate / L2
    if not spring.tension_only:
        return elastic, damping
    if spring.damping:
        damping = choose(elastic > 0.0, larger(damping, -elastic), 0.0)
    return larger(elastic, 0.0), damping


def stored(spring: PointSpring, square: Quantity) -> Quantity:
    """Energy of a spring between points in [J], the integral of its elastic tension.

    A cord without stiffness, such as a weight on a pulley, stores its force times its length.
    """
    k, L = spring.stiffness, root(square + NEAR**2)
    if spring.tension_only and k:
        return larger(k * (L - spring.rest_length) + spring.force, 0.0) ** 2 / (2.0 * k)
    return 0.5 * k * (L - spring.rest_length) ** 2 + spring.force * L


def torque(springs: Springs, tree: Tree, q: ca.SX, v: ca.SX) -> ca.SX:
    """S(q, v) in [N m] or [N], shape (n,).

    Args:
        springs: The springs.
        tree: The links.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
    """
    elastic, damping = _parts(springs, tree, q, v)
    return elastic + damping


def heat(springs: Springs, tree: Tree, q: ca.SX, v: ca.SX) -> ca.SX:
    """Power dissipated by the dampers in [W]; arguments as of ``torque``."""
    return ca.dot(_parts(springs, tree, q, v)[1], v)


def energy(springs: Springs, tree: Tree, q: ca.SX) -> ca.SX:
    """Energy stored in the springs in [J]; arguments as of ``torque``."""
    x = _full(tree, q) - constant(springs.rest)
    total = ca.sum1(springs.stored(x))
    for spring, (square, _) in zip(springs.points, _lengths(springs, tree, q), strict=True):
        total += stored(spring, square)
    return total


def frictionless(
    springs: Springs, tree: Tree, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
) -> ca.SX:
    """Torques M a + C v + G + S, shape (n,); see ``rigid_body.inverse_dynamics``."""
    return rigid_body.inverse_dynamics(tree, q, v, a, gravity) + torque(springs, tree, q, v)


def _parts(springs: Springs, tree: Tree, q: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The elastic part of S, and that of the dampers."""
    E = spread_map(tree)
    elastic = E.T @ springs.pull(_full(tree, q) - constant(springs.rest))
    damping = E.T @ (constant(springs.damping) * (E @ v))
    for spring, (square, slope) in zip(springs.points, _lengths(springs, tree, q), strict=True):
        static, moving = tension(spring, square, ca.dot(slope, v))
        elastic, damping = elastic + static * slope, damping + moving * slope
    return elastic, damping


def _full(tree: Tree, q: ca.SX) -> ca.SX:
    """Positions of all links' joints."""
    return spread_map(tree) @ q + constant(tree.offsets)


def _lengths(springs: Springs, tree: Tree, q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """u·u in [m²] of each spring between points, and the slope ∂(u·u/2)/∂q, shape (n,)."""
    at = ca.SX.sym("q", q.shape[0])  # derivatives are taken by symbols; q may be an expression
    pose = rigid_body.placements(tree, at) if springs.points else []
    lengths = []
    for spring in springs.points:
        frames = [springs.frames[name] for name in spring.frames]
        square = ca.sumsqr(relative(tree, pose, frames, spring.points)[1])
        both = ca.Function("way", [at], [square, ca.gradient(square, at) / 2])
        lengths.append(both(q))
    return lengths


def stop_pressures(q: ca.SX, v: ca.SX, place: Array, stiffness: Array, damping: Array) -> ca.SX:
    """Torques of compliant end stops, provided that the joint touches them.

    A stop is a spring and a damper that never pull: the joint separates when their sum would pull,
    which with damping is before the spring is relaxed (Brogliato, Nonsmooth Mechanics, 2016,
    section 2.1).

    Args:
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities in [rad/s] or [m/s], shape (n,).
        place: Positions of the lower and the upper stops in [rad] or [m], shape (2, n).
        stiffness: Stiffness in [N m/rad] or [N/m], zero for rigid stops, shape (2, n).
        damping: Damping in [N m s/rad] or [N s/m], shape (2, n).

    Returns:
        Torques in [N m] or [N] away from the lower and from the upper stops, positive where they
        push, shape (2 n,); zero for rigid stops.
    """
    pressures = []
    for side, sign in ((0, -1.0), (1, 1.0)):
        for i in range(q.shape[0]):
            k, c = stiffness[side, i], damping[side, i]
            push = k * (sign * (q[i] - place[side, i])) + c * (sign * v[i]) if k else ca.SX(0)
            pressures.append(push)
    return ca.vertcat(*pressures)
