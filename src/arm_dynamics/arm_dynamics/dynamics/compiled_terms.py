# SPDX-License-Identifier: Apache-2.0
"""The terms available for batches: their expressions and the measures of their errors.

The expressions are those of ``equations``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array, each
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.dynamics.verify import torque_size
from arm_dynamics.equations import constraint, frame, rigid_body, spring
from arm_dynamics.equations.forward_dynamics import algorithms
from arm_dynamics.exceptions import known_names
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.springs import springs_of
from arm_dynamics.model.tree_builder import frame_of, gravity_of, linkage_of, tree_of

Answer = Callable[..., Array]
Parts = list[tuple[Array, Array]]


@dataclass(frozen=True)
class BatchTerm:
    """One term of the equation of motion.

    Attributes:
        title: Its name, for display.
        point: Method of ``RigidTerms`` that computes it at one point.
        expression: Builds the function of one point's vectors for an arm; a matrix is transposed.
        compared: Differences from Pinocchio's results at states q, v and accelerations or torques,
            and reference sizes: see ``verify.compare``.
        is_matrix: Whether the result for a point is a matrix, not a vector.
    """

    title: str
    point: Answer
    expression: Callable[[Robot], ca.Function]
    compared: Callable[[RigidTerms, Answer, Array, Array, Array], Parts]
    is_matrix: bool = False


def _inverse(robot: Robot) -> ca.Function:
    q, v, a = (ca.SX.sym(name, robot.n) for name in "qva")
    gravity = ca.SX.sym("gravity", 3)
    return _function([q, v, a, gravity], rigid_body.inverse(tree_of(robot), q, v, a, gravity))


def _inverse_parts(points: RigidTerms, answer: Answer, q: Array, v: Array, a: Array) -> Parts:
    still, none, weight = np.zeros_like(q), np.zeros(3), np.array(points.robot.scene.gravity)
    parts = (
        each(points.inverse, q, still, a, none),
        each(points.inverse, q, v, still, none),
        each(points.inverse, q, still, still, weight),
    )
    size = np.sum(np.abs(parts), axis=0)
    return [(answer(q, v, a, g) - each(points.inverse, q, v, a, g), size) for g in (weight, none)]


def _forward(robot: Robot) -> ca.Function:
    q, v, tau = (ca.SX.sym(name, robot.n) for name in ("q", "v", "tau"))
    tree, gravity = tree_of(robot), gravity_of(robot)
    ways = [
        _function([q, v, tau], forward(tree, q, v, tau, gravity))
        for _, forward in algorithms(tree, robot.n)
    ]
    return min(ways, key=operations)


def _forward_parts(points: RigidTerms, answer: Answer, q: Array, v: Array, tau: Array) -> Parts:
    a = answer(q, v, tau)
    bias = each(points.inverse, q, v, np.zeros_like(q))
    size = torque_size(each(points.mass, q), a, bias, tau)
    return [(each(points.inverse, q, v, a) - tau, size)]


def _mass_matrix(robot: Robot) -> ca.Function:
    q = ca.SX.sym("q", robot.n)
    return _function([q], rigid_body.mass_matrix(tree_of(robot), q))


def _relative_to_itself(point: Callable[..., Array]) -> Callable[..., Parts]:
    """The comparison of a function of q whose own size is that of its summands."""

    def compared(points: RigidTerms, answer: Answer, q: Array, *_: Array) -> Parts:
        expected = each(partial(point, points), q)
        return [(answer(q) - expected, expected)]

    return compared


def _coriolis_matrix(robot: Robot) -> ca.Function:
    q, v = (ca.SX.sym(name, robot.n) for name in "qv")
    return _function([q, v], rigid_body.coriolis_matrix(tree_of(robot), q, v).T)


def _coriolis_parts(points: RigidTerms, answer: Answer, q: Array, v: Array, _: Array) -> Parts:
    difference = answer(q, v) - each(points.coriolis, q, v)
    fastest = abs(v).max(axis=1)[:, None, None]
    return [(difference, each(points.mass, q) * fastest)]


def _gravity(robot: Robot) -> ca.Function:
    q = ca.SX.sym("q", robot.n)
    return _function([q], rigid_body.gravity_torque(tree_of(robot), q, gravity_of(robot)))


def _gravity_parts(points: RigidTerms, answer: Answer, q: Array, *_: Array) -> Parts:
    G = each(points.gravity, q)
    inertia = abs(each(points.mass, q)).sum(axis=2)
    return [(answer(q) - G, abs(G) + inertia)]


def _spring(robot: Robot) -> ca.Function:
    q, v = (ca.SX.sym(name, robot.n) for name in "qv")
    return _function([q, v], spring.torque(springs_of(robot), tree_of(robot), q, v))


def _spring_parts(points: RigidTerms, answer: Answer, q: Array, v: Array, _: Array) -> Parts:
    S = each(points.spring, q, v)
    inertia = abs(each(points.mass, q)).sum(axis=2)
    return [(answer(q, v) - S, abs(S) + inertia)]


def _energies(robot: Robot) -> ca.Function:
    q, v = (ca.SX.sym(name, robot.n) for name in "qv")
    still, none = ca.SX(robot.n, 1), ca.SX(3, 1)
    momentum = rigid_body.inverse(tree_of(robot), q, still, v, none)  # M v, without forming M
    whole, gravity = tree_of(robot, regroup=False), gravity_of(robot)
    potential = rigid_body.potential_energy(whole, q, gravity)
    potential += spring.energy(springs_of(robot), whole, q)
    return _function([q, v], ca.vertcat(ca.dot(v, momentum) / 2, potential))


def _energy_parts(points: RigidTerms, answer: Answer, q: Array, v: Array, _: Array) -> Parts:
    expected = each(points.energies, q, v)
    kinetic, potential = abs(expected).T
    sizes = kinetic, kinetic + potential
    return list(zip((answer(q, v) - expected).T, sizes, strict=True))


@cache
def constraint_rows(names: tuple[str, ...]) -> BatchTerm:
    """A and γ side by side of the named constraints; cached by the names."""
    point = partial(RigidTerms.constraint_rows, names=names)

    def expression(robot: Robot) -> ca.Function:
        q, v = (ca.SX.sym(name, robot.n) for name in "qv")
        known = ConstraintRows(robot)
        listed = zip(known.names, known.places, known.counts, strict=True)
        every = {place: range(count) for name, place, count in listed if name in names}
        tree, linkage = tree_of(robot), linkage_of(robot, every)
        alone = [replace(linkage, constraints={i: linkage.constraints[i]}) for i in every]
        rows = [constraint.rows(one, tree, q, v, lambda _: 1.0) for one in alone]
        A = ca.vertcat(ca.SX(0, robot.n), *(row.jacobian for row in rows))
        drift = ca.vertcat(ca.SX(0, 1), *(row.drift for row in rows))
        return _function([q, v], ca.horzcat(A, drift).T)

    def compared(points: RigidTerms, answer: Answer, q: Array, v: Array, _: Array) -> Parts:
        expected = each(partial(point, points), q, v)
        size = abs(expected)
        fastest = abs(v).max(axis=1)[:, None] ** 2
        size[..., -1] += size[..., :-1].max(axis=2, initial=0.0) * fastest
        difference = answer(q, v) - expected
        return [(difference[..., :-1], size[..., :-1]), (difference[..., -1], size[..., -1])]

    title = f"rows of constraints {known_names(names)}"
    return BatchTerm(title, point, expression, compared, True)


@cache
def pose(name: str) -> BatchTerm:
    """Homogeneous transformation of a frame; cached by its name, as are the next two."""
    point = partial(RigidTerms.pose, frame=name)

    def expression(robot: Robot) -> ca.Function:
        q = ca.SX.sym("q", robot.n)
        p, R = frame.placement(tree_of(robot), frame_of(robot, name), q)
        last = ca.SX([[0.0, 0.0, 0.0, 1.0]])
        return _function([q], ca.vertcat(ca.horzcat(R, p), last).T)

    return BatchTerm(
        f"pose of frame '{name}'", point, expression, _relative_to_itself(point), True
    )


@cache
def jacobian(name: str) -> BatchTerm:
    """Jacobian of a frame in world axes at its origin, linear rows first."""
    point = partial(RigidTerms.jacobian, frame=name)

    def expression(robot: Robot) -> ca.Function:
        q = ca.SX.sym("q", robot.n)
        return _function([q], frame.jacobian(tree_of(robot), frame_of(robot, name), q).T)

    return BatchTerm(
        f"Jacobian of frame '{name}'", point, expression, _relative_to_itself(point), True
    )


@cache
def jacobian_derivative(name: str) -> BatchTerm:
    """Derivative by time of the same Jacobian."""
    point = partial(RigidTerms.jacobian_derivative, frame=name)

    def expression(robot: Robot) -> ca.Function:
        q, v = (ca.SX.sym(symbol, robot.n) for symbol in "qv")
        J = frame.jacobian(tree_of(robot), frame_of(robot, name), q)
        return _function([q, v], frame.derivative(J, q, v).T)

    def compared(points: RigidTerms, answer: Answer, q: Array, v: Array, _: Array) -> Parts:
        fastest = abs(v).max(axis=1)[:, None, None]
        size = fastest * each(partial(points.jacobian, frame=name), q)
        return [(answer(q, v) - each(partial(point, points), q, v), size)]

    return BatchTerm(f"derivative of J of frame '{name}'", point, expression, compared, True)


OF_FRAMES = {"pose": pose, "jacobian": jacobian, "jacobian_derivative": jacobian_derivative}
"""The terms of a frame."""


INVERSE = BatchTerm("inverse dynamics", RigidTerms.inverse, _inverse, _inverse_parts)
FORWARD = BatchTerm("forward dynamics", RigidTerms.forward, _forward, _forward_parts)
MASS_MATRIX = BatchTerm(
    "mass matrix",
    RigidTerms.mass,
    _mass_matrix,
    _relative_to_itself(RigidTerms.mass),
    is_matrix=True,
)
CORIOLIS_MATRIX = BatchTerm(
    "Coriolis matrix", RigidTerms.coriolis, _coriolis_matrix, _coriolis_parts, is_matrix=True
)
GRAVITY = BatchTerm("gravity", RigidTerms.gravity, _gravity, _gravity_parts)
SPRING = BatchTerm("springs", RigidTerms.spring, _spring, _spring_parts)
ENERGIES = BatchTerm("energies", RigidTerms.energies, _energies, _energy_parts)


def _function(arguments: list[ca.SX], result: ca.SX) -> ca.Function:
    return ca.Function("point", arguments, [ca.densify(result)], {"cse": True})
