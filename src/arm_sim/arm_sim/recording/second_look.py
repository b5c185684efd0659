# SPDX-License-Identifier: Apache-2.0
"""A second look at a motion: some of its ticks, made again with half the step.

A closed energy account does not show that every event was seen: a motion that passes one over may
keep its energy. A tick that is made again from its recorded start, in two halves and under a
tolerance a hundred times smaller, evaluates all guards at other instants; where the ends differ by
more than the method allows, one of the two is wrong. Steps of fixed length between two events
within a tick are halved, too.

Half of the ticks are those at which velocities change most abruptly, which is where events are;
the others are drawn at random, by a seed of their own, so that the same motion gets the same look.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_sim.integrators.selection import SECOND_LOOK, Choice

Indices = NDArray[np.intp]

FEWEST = 20
"""Least number of ticks that are made again."""
FINER = 1e-2
"""Tolerance of the second look, relative to that of the motion ..."""
FINEST = 1e-13
"""... but not below this, which rounding allows no step to meet reliably."""
ALLOWED, ALLOWED_FIXED = 10.0, 1e-6
"""Trusted differences: in tolerances or stated errors, and with steps of fixed length."""
CARRIED = 100
"""Ticks for which an error of a velocity is taken to last."""


@dataclass(frozen=True)
class Ticks:
    """Some ticks of a motion.

    Attributes:
        x: States at the beginning of each, shape (k, nx), which start with q and v of n each.
        after: States at its end, likewise.
        u: Effective commands, shape (k, n).
        p: Tunable quantities, shape (k, np).
        error: Estimated errors of q in each, shape (k,), zero without estimate.
    """

    x: Array
    after: Array
    u: Array
    p: Array
    error: Array


@dataclass(frozen=True)
class SecondLook:
    """Ticks that were made again.

    Attributes:
        ticks: Their indices, shape (m,).
        difference: Difference of the two ends of each, relative to 1 + |q|, shape (m,): the
            largest of |Δq| and of |Δv| over a tick, with steps of fixed length of |Δq| + |Δv| for
            as long as it lasts; NaN where the second tick cannot be computed.
        joint: Index of the joint with that difference, shape (m,).
        allowed: Largest difference that is trusted, shape (m,).
        error: Estimated error of q over the whole motion, relative to 1 + |q|: the differences of
            all ticks, with those of the velocities for as long as they last.
    """

    ticks: Indices
    difference: Array
    joint: Indices
    allowed: Array
    error: float

    @property
    def agrees(self) -> bool:
        """Whether every difference is allowed."""
        return bool((self.difference <= self.allowed).all())

    @property
    def worst(self) -> int:
        """Index of the tick that exceeds most what is allowed, among ``ticks``."""
        excess = self.difference / self.allowed
        return int(np.argmax(np.where(np.isnan(excess), np.inf, excess)))


def second_look(
    change: Array, usable: Array, choice: Choice, ticks: Callable[[Indices], Ticks],
    made_finer: Callable[[Ticks], Array],
) -> SecondLook:  # fmt: skip
    """Look at a motion a second time.

    Args:
        change: Change of the velocities in every tick, shape (k, n).
        usable: Whether each can be made again, shape (k,).
        choice: Method, tick and tolerance of the motion.
        ticks: The ticks with some indices.
        made_finer: Ends of ticks that are made again, of shape (m, nx).
    """
    count, n = change.shape
    able = np.flatnonzero(usable)
    abrupt, random = drawn(able, change)
    rows = np.concatenate([abrupt, random])
    if not len(rows):
        return SecondLook(rows, np.zeros(0), rows, np.zeros(0), 0.0)
    some = ticks(rows)
    size = 1.0 + abs(some.after[:, :n])
    apart = abs(made_finer(some) - some.after)
    of_q, of_v = apart[:, :n] / size, choice.dt * apart[:, n : 2 * n] / size
    lasts = np.minimum(count - rows, CARRIED)[:, None]
    carried = of_q + lasts * of_v
    ways = carried if choice.tolerance is None else np.maximum(of_q, of_v)
    least = ALLOWED_FIXED if choice.tolerance is None else ALLOWED * choice.tolerance
    allowed = np.maximum(least, ALLOWED * some.error)
    each = carried.max(axis=1)
    rest = len(able) - len(abrupt)
    error = each[: len(abrupt)].sum() + rest * (each[len(abrupt) :].mean() if len(random) else 0.0)
    return SecondLook(rows, ways.max(axis=1), ways.argmax(axis=1), allowed, float(error))


def finer_tolerance(tolerance: float) -> float:
    """Tolerance of the second look at a motion with a tolerance."""
    return max(FINER * tolerance, min(tolerance, FINEST))


def drawn(usable: Indices, change: Array) -> tuple[Indices, Indices]:
    """The ticks to be made again, of those that can be: the most abrupt ones, and random ones.

    Args:
        usable: Indices of those that can be.
        change: Change of the velocities in every tick, shape (k, n).
    """
    count = min(len(usable), max(FEWEST, round(SECOND_LOOK * len(usable))))
    kept = change if len(usable) == len(change) else change[usable]
    jerk = np.zeros(len(usable))
    for of_joint in kept.T:
        np.maximum(jerk[1:], abs(np.diff(of_joint)), out=jerk[1:])
    most = (count + 1) // 2
    abrupt = np.argpartition(-jerk, most - 1)[:most] if most else usable[:0]
    left = np.ones(len(usable), dtype=bool)
    left[abrupt] = False
    others = np.flatnonzero(left)
    chance = np.random.default_rng(len(usable))
    random = others[chance.choice(len(others), min(len(others), count - most), replace=False)]
    return usable[np.sort(abrupt)], usable[np.sort(random)]
