# SPDX-License-Identifier: Apache-2.0
"""Continuous output of explicit Runge-Kutta methods: the state in the middle of a step.

With the stages of a method, weights w give x(h/2) = x + h Σ w_i k_i of an order that the stages
allow: the order conditions Σ w_i Φ_i(t) = (1/2)^r / γ(t), for all rooted trees t of r nodes, are
linear in w (Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd edition 1993,
II.2 and II.6). The weights for RK4 also meet the further conditions of ``nystrom4`` up to order 3.
"""

from functools import cache
from itertools import combinations_with_replacement

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.integrators.tableaux import Tableau

# Order up to which conditions are solved
MAX_ORDER = 6
# Largest residual of order conditions that are satisfied
RESIDUAL_TOLERANCE = 1e-9

# A rooted tree: the subtrees at its root
Tree = tuple["Tree", ...]


def stage_at_end(tableau: Tableau) -> int | None:
    """The last stage at the end of the step; None if there is none."""
    at_end = [i for i, row in enumerate(tableau.a) if abs(sum(row) - 1.0) < 1e-12]
    return at_end[-1] if at_end else None


def needs_slope_at_end(tableau: Tableau) -> bool:
    """Whether a method under error control has no stage at the end of its step."""
    return bool(tableau.errors) and tableau.a[-1] != tableau.b[: len(tableau.a) - 1]


@cache
def middle_weights(tableau: Tableau) -> tuple[float, ...]:
    """Weights of the stages for the state in the middle of a step, of the highest order possible.

    Of several solutions, that of least norm. Where ``needs_slope_at_end``, that is one stage more.
    """
    rows = [*tableau.a, tableau.b] if needs_slope_at_end(tableau) else list(tableau.a)
    stages = len(rows)
    a = np.array([[*row, *[0.0] * (stages - len(row))] for row in rows])
    conditions: list[Array] = []
    values: list[float] = []
    weights = np.zeros(stages)
    for order in range(1, MAX_ORDER + 1):
        for tree in _trees(order):
            conditions.append(_weight(tree, a))
            values.append(0.5**order / _density(tree))
        matrix, right = np.array(conditions), np.array(values)
        solution = np.linalg.lstsq(matrix, right, rcond=None)[0]
        if abs(matrix @ solution - right).max() > RESIDUAL_TOLERANCE:
            break
        weights = solution
    return tuple(weights.tolist())


@cache
def _trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees with that many nodes."""
    if order == 1:
        return ((),)
    smaller = [tree for size in range(1, order) for tree in _trees(size)]
    return tuple(
        subtrees
        for count in range(1, order)
        for subtrees in combinations_with_replacement(smaller, count)
        if sum(map(_size, subtrees)) == order - 1
    )


def _size(tree: Tree) -> int:
    return 1 + sum(map(_size, tree))


def _density(tree: Tree) -> int:
    product = _size(tree)
    for subtree in tree:
        product *= _density(subtree)
    return product


def _weight(tree: Tree, a: Array) -> Array:
    """Elementary weights Φ_i of a tree, shape (stages,)."""
    weight = np.ones(len(a))
    for subtree in tree:
        weight = weight * (a @ _weight(subtree, a))
    return weight
