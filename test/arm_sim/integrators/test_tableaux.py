# SPDX-License-Identifier: Apache-2.0
"""Order conditions of the Runge-Kutta tableaux, one for each rooted tree (Butcher, 1963; Hairer,
Nørsett, Wanner, Solving Ordinary Differential Equations I, 1993, section II.2): a method of
order p meets all of up to p nodes.
"""

from functools import cache
from itertools import combinations_with_replacement
from math import prod

import numpy as np
import pytest

from arm_sim.integrators.methods import METHODS
from tolerances import CLOSED_FORM

Tree = tuple["Tree", ...]
TABLEAUX = {name: method.tableau for name, method in METHODS.items() if method.tableau is not None}


@cache
def trees(nodes: int) -> list[Tree]:
    """All rooted trees with that many nodes; a tree is the sorted tuple of its branches."""
    return sorted({tuple(sorted(branches)) for branches in forests(nodes - 1)})


@cache
def forests(nodes: int) -> list[Tree]:
    if nodes == 0:
        return [()]
    found: list[Tree] = []
    for biggest in range(1, nodes + 1):
        for count in range(1, nodes // biggest + 1):
            for some in combinations_with_replacement(trees(biggest), count):
                rest = forests(nodes - biggest * count)
                found += [
                    (*some, *others) for others in rest if all(size(o) < biggest for o in others)
                ]
    return found


def size(tree: Tree) -> int:
    return 1 + sum(size(branch) for branch in tree)


def density(tree: Tree) -> int:
    return size(tree) * prod(density(branch) for branch in tree)


def stages(tree: Tree, A: np.ndarray) -> np.ndarray:
    return np.prod([np.ones(len(A)), *(A @ stages(branch, A) for branch in tree)], axis=0)


def residual(tree: Tree, A: np.ndarray, b: np.ndarray) -> float:
    return float(b @ stages(tree, A) * density(tree) - 1.0)


def matrix(rows: tuple[tuple[float, ...], ...]) -> np.ndarray:
    return np.array([[*row, *[0.0] * (len(rows) - len(row))] for row in rows])


def test_number_of_trees() -> None:
    """1, 1, 2, 4, 9, 20, 48, 115, 286: Cayley's count."""
    assert [len(trees(nodes)) for nodes in range(1, 10)] == [1, 1, 2, 4, 9, 20, 48, 115, 286]


@pytest.mark.parametrize("name", TABLEAUX)
def test_conditions_up_to_the_stated_order(name: str) -> None:
    tableau = TABLEAUX[name]
    A, b = matrix(tableau.a), np.array(tableau.b)
    for nodes in range(1, tableau.order + 1):
        worst = max(abs(residual(tree, A, b)) for tree in trees(nodes))
        assert worst < CLOSED_FORM, f"order {nodes}: {worst:.1e}"
