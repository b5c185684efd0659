# SPDX-License-Identifier: Apache-2.0
"""The terms that batches are asked for: as expressions, and what their error is measured by.

The expressions are those of ``equations``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import attrgetter

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array, each
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.dynamics.verify import random_states, torque_size
from arm_dynamics.equations import constraint, rigid_body
from arm_dynamics.equations.forward_dynamics import algorithms
from arm_dynamics.exceptions import known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.model.robot import Robot
from arm_dynamics.model.tree_builder import gravity_of, linkage_of, tree_of

Answer = Callable[..., Array]
Parts = list[tuple[Array, Array]]


@dataclass(frozen=True)
class BatchTerm:
    """One term.

    Attributes:
        name: Name of its function.
        title: The same for display.
        point: From Pinocchio's terms to the function that answers for one point.
        shape: Of its answer.
        expression: From an arm to the function of one point's vectors, a matrix transposed.
        compared: Differences of an answer from Pinocchio's at random states, and sizes: see
            ``verify.compare``.
    """

    name: str
    title: str
    point: Callable[[RigidTerms], Answer]
    shape: Callable[[ArmModel], tuple[int, ...]]
    expression: Callable[[ArmModel], ca.Function]
    compared: Callable[[RigidTerms, Answer], Parts]


def _inverse(model: ArmModel) -> ca.Function:
    q, v, a = _symbols(model.n, "qva")
    gravity = ca.SX.sym("gravity", 3)
    return _function([q, v, a, gravity], rigid_body.inverse(tree_of(model), q, v, a, gravity))


def _inverse_parts(points: RigidTerms, answer: Answer) -> Parts:
    q, v, a = random_states(points.robot.n)
    still, none, weight = np.zeros_like(q), np.zeros(3), _weight(points.robot)
    parts = (
        each(points.inverse, q, still, a, none),
        each(points.inverse, q, v, still, none),
        each(points.inverse, q, still, still, weight),
    )
    size = np.sum(np.abs(parts), axis=0)
    return [(answer(q, v, a, g) - each(points.inverse, q, v, a, g), size) for g in (weight, none)]


def _forward(model: ArmModel) -> ca.Function:
    q, v, tau = _symbols(model.n, ("q", "v", "tau"))
    tree, gravity = tree_of(model), gravity_of(model)
    ways = [
        _function([q, v, tau], forward(tree, q, v, tau, gravity))
        for _, forward in algorithms(tree, model.n)
    ]
    return min(ways, key=operations)


def _forward_parts(points: RigidTerms, answer: Answer) -> Parts:
    q, v, tau = random_states(points.robot.n)
    a, still, weight = answer(q, v, tau), np.zeros_like(q), _weight(points.robot)
    bias = each(points.inverse, q, v, still, weight)
    size = torque_size(each(points.mass, q), a, bias, tau)
    return [(each(points.inverse, q, v, a, weight) - tau, size)]


def _mass_matrix(model: ArmModel) -> ca.Function:
    (q,) = _symbols(model.n, "q")
    return _function([q], rigid_body.mass_matrix(tree_of(model), q))


def _mass_parts(points: RigidTerms, answer: Answer) -> Parts:
    q, _, _ = random_states(points.robot.n)
    M = each(points.mass, q)
    return [(answer(q) - M, M)]


def _coriolis_matrix(model: ArmModel) -> ca.Function:
    q, v = _symbols(model.n, "qv")
    return _function([q, v], rigid_body.coriolis_matrix(tree_of(model), q, v).T)


def _coriolis_parts(points: RigidTerms, answer: Answer) -> Parts:
    q, v, _ = random_states(points.robot.n)
    difference = answer(q, v) - each(points.coriolis, q, v)
    fastest = abs(v).max(axis=1)[:, None, None]
    return [(difference, each(points.mass, q) * fastest)]


def _gravity(model: ArmModel) -> ca.Function:
    (q,) = _symbols(model.n, "q")
    return _function([q], rigid_body.gravity_torque(tree_of(model), q, gravity_of(model)))


def _gravity_parts(points: RigidTerms, answer: Answer) -> Parts:
    q, _, _ = random_states(points.robot.n)
    G = each(points.gravity, q)
    inertia = abs(each(points.mass, q)).sum(axis=2)
    return [(answer(q) - G, abs(G) + inertia)]


def _energies(model: ArmModel) -> ca.Function:
    q, v = _symbols(model.n, "qv")
    still, none = ca.SX(model.n, 1), ca.SX(3, 1)
    momentum = rigid_body.inverse(tree_of(model), q, still, v, none)  # M v, without all of M
    whole, gravity = tree_of(model, regroup=False), gravity_of(model)
    return _function(
        [q, v], ca.vertcat(ca.dot(v, momentum) / 2, rigid_body.potential_energy(whole, q, gravity))
    )


def _energy_parts(points: RigidTerms, answer: Answer) -> Parts:
    q, v, _ = random_states(points.robot.n)
    expected = each(points.energies, q, v)
    kinetic, potential = abs(expected).T
    sizes = kinetic, kinetic + potential
    return list(zip((answer(q, v) - expected).T, sizes, strict=True))


def constraint_rows(names: tuple[str, ...]) -> BatchTerm:
    """A and γ side by side of the constraints of these names."""

    def expression(model: ArmModel) -> ca.Function:
        q, v = _symbols(model.n, "qv")
        named = ConstraintRows(model)
        places = [i for i, name in zip(named.places, named.names, strict=True) if name in names]
        sides = constraint.complete_rows(
            linkage_of(model, model.constraint_rows), tree_of(model), q, v, places
        )
        return _function([q, v], ca.horzcat(*sides).T)

    def shape(model: ArmModel) -> tuple[int, ...]:
        named = ConstraintRows(model)
        pairs = zip(named.counts, named.names, strict=True)
        return sum(count for count, name in pairs if name in names), model.n + 1

    def compared(points: RigidTerms, answer: Answer) -> Parts:
        q, v, _ = random_states(points.robot.n)
        expected = each(point(points), q, v)
        size = abs(expected)
        fastest = abs(v).max(axis=1)[:, None] ** 2
        size[..., -1] += size[..., :-1].max(axis=2, initial=0.0) * fastest
        difference = answer(q, v) - expected
        return [(difference[..., :-1], size[..., :-1]), (difference[..., -1], size[..., -1])]

    def point(points: RigidTerms) -> Answer:
        return partial(points.constraint_rows, names=names)

    title = f"rows of constraints {known_names(names)}"
    return BatchTerm(f"constraint_rows {names}", title, point, shape, expression, compared)


def _vector(model: ArmModel) -> tuple[int, ...]:
    return (model.n,)


def _square(model: ArmModel) -> tuple[int, ...]:
    return (model.n, model.n)


def _pair(_: ArmModel) -> tuple[int, ...]:
    return (2,)


INVERSE = BatchTerm(
    "inverse", "inverse dynamics", attrgetter("inverse"), _vector, _inverse, _inverse_parts
)
FORWARD = BatchTerm(
    "forward", "forward dynamics", attrgetter("forward"), _vector, _forward, _forward_parts
)
MASS_MATRIX = BatchTerm(
    "mass_matrix", "mass matrix", attrgetter("mass"), _square, _mass_matrix, _mass_parts
)
CORIOLIS_MATRIX = BatchTerm(
    "coriolis_matrix",
    "Coriolis matrix",
    attrgetter("coriolis"),
    _square,
    _coriolis_matrix,
    _coriolis_parts,
)
GRAVITY = BatchTerm("gravity", "gravity", attrgetter("gravity"), _vector, _gravity, _gravity_parts)
ENERGIES = BatchTerm(
    "energies", "energies", attrgetter("energies"), _pair, _energies, _energy_parts
)


def _symbols(n: int, names: str | tuple[str, ...]) -> list[ca.SX]:
    return [ca.SX.sym(name, n) for name in names]


def _function(arguments: list[ca.SX], result: ca.SX) -> ca.Function:
    return ca.Function("point", arguments, [ca.densify(result)], {"cse": True})


def _weight(model: Robot) -> Array:
    return np.array(model.scene.gravity, dtype=float)
