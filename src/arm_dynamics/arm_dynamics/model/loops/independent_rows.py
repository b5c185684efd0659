# SPDX-License-Identifier: Apache-2.0
"""Rows of constraints that imply all others, chosen greedily in the metric of M."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ConstraintError
from arm_dynamics.model.constraint_rows import ConstraintRows
from arm_dynamics.model.loops.loop_closure import Closure
from arm_dynamics.model.loops.mass_metric import RANK

# Rows are treated as equal if the logarithms of their new components differ by less.
TIE = 1e-6


def independent_rows(closure: Closure, near: Array) -> dict[int, tuple[int, ...]]:
    """Independent rows, which imply all others wherever the constraints are closed.

    A row of a constraint that can be switched off is left out only if it is implied by permanent
    constraints and other rows of its own.

    Args:
        closure: Closure of the robot.
        near: Joint positions to start from, shape (n,).

    Returns:
        Indices of the rows to keep, by the constraint's index in the scene's list.
    """
    rows = closure.rows
    owner = np.repeat(np.arange(len(rows.names)), rows.counts)
    fixed = [i for i, constraint in enumerate(rows.constraints) if not constraint.switchable]
    kept = _pivots(closure, fixed, np.flatnonzero(np.isin(owner, fixed)), [], near)
    extra = [
        k for i in range(len(rows.names)) if i not in fixed
        for k in _pivots(closure, [*fixed, i], np.flatnonzero(owner == i), kept, near)
    ]  # fmt: skip
    kept = sorted([*kept, *extra])
    first = np.concatenate([[0], np.cumsum(rows.counts)])
    return {
        place: tuple(int(k - first[i]) for k in kept if owner[k] == i)
        for i, place in enumerate(rows.places)
    }


def is_independent(
    rows: ConstraintRows, names: tuple[str, ...], independent: Mapping[int, tuple[int, ...]]
) -> list[bool]:
    """Whether each row of the named constraints, stacked, is among the ``independent_rows``."""
    whole = zip(rows.names, rows.places, rows.counts, strict=True)
    named = [(place, count) for name, place, count in whole if name in names]
    return [k in independent[place] for place, count in named for k in range(count)]


def _pivots(
    closure: Closure, active: list[int], candidates: NDArray[np.intp], kept: list[int], near: Array
) -> list[int]:
    """Greedily select the row with the largest component independent of those selected."""
    rows = closure.rows
    names = tuple(rows.names[i] for i in sorted(active))
    if not len(candidates):
        return []
    try:
        places = closure.sample_positions(near, names)
    except ConstraintError:  # an inactive constraint need not be closable
        return [int(k) for k in candidates]
    jacobians = [rows.stacked(q, 0 * q, rows.names).jacobian for q in places]
    bases = [closure.whitened(q, A) for q, A in zip(places, jacobians, strict=True)]
    for k in kept:
        bases = [_without(Y, k) for Y in bases]
    pivots = list[int]()
    for _ in range(closure.rank(names, near) - len(kept)):
        sizes = np.array([np.linalg.norm(Y[candidates], axis=1) for Y in bases])
        # One of the positions may happen to be singular, so no single one decides.
        novelty = np.log(np.maximum(sizes, RANK)).sum(0)
        # The first of equals, so that rounding, which differs between machines, does not decide.
        best = int(candidates[np.argmax(novelty > novelty.max() - TIE)])
        bases = [_without(Y, best) for Y in bases]
        pivots.append(best)
    return pivots


def _without(Y: Array, k: int) -> Array:
    """Rows with their components along row ``k`` removed."""
    size = np.linalg.norm(Y[k])
    y = Y[k] / size if size > RANK else np.zeros_like(Y[k])
    return np.asarray(Y - np.outer(Y @ y, y))
