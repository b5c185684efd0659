# SPDX-License-Identifier: Apache-2.0
"""Limits of sets that hold together, by linear programs.

A friction cone in space is replaced by the half-spaces that touch it where the last solution was
outside, until none is (Kelley, "The cutting-plane method for solving convex programs", J. SIAM 8,
1960).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from arm_dynamics.arrays import Array

CUTS, OUTSIDE = 400, 1e-10
EXACT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
MOST = 1e4
"""Factor of the load beyond which a set is said to jam."""
STILL = 1e-6
"""Acceleration that is rest, relative to the largest."""


@dataclass(frozen=True)
class Cone:
    """A contact that touches."""

    # Generalized forces per normal force and per tangential force, shape (n, 2 or 3)
    columns: Array
    friction: float  # coefficient of sliding friction
    static: float  # coefficient of static friction


@dataclass(frozen=True)
class Set:
    """Parts that hold together under a load, which grows in a direction.

    At rest, weight + base + factor along + reactions of joints, constraints and contacts = 0.
    """

    weight: Array  # generalized forces of gravity, shape (n,)
    base: Array  # load at the factor 0, shape (n,)
    along: Array  # load per unit of the factor, shape (n,)
    dry: Array  # friction of the joints, sliding and static, zero without, shape (2, n)
    supports: Array  # directions in which rigid stops bear joints: -1, 0 or 1, shape (n,)
    rows: Array  # rows of the constraints, shape (m, n)
    cones: tuple[Cone, ...]  # the contacts

    @property
    def indeterminate(self) -> bool:
        """Whether some combination of the reactions moves nothing."""
        held = np.eye(len(self.weight))[:, (self.dry[1] > 0.0) | (self.supports != 0.0)]
        both = np.hstack([held, *(cone.columns for cone in self.cones)])
        free = np.linalg.svd(np.vstack([self.rows, np.zeros_like(self.weight)]))
        rank = int(np.sum(free[1] > 1e-9))
        return both.shape[1] > np.linalg.matrix_rank(free[2][rank:] @ both, tol=1e-9)


class Forces:
    """Unknown reactions: those of joints, of constraints, of contacts.

    Args:
        of: The set.
        sliding: Joints that do not hold.
        along: Accelerations of the contacts: those that open transmit no force, those that slide
            the sliding friction against their direction; None if all stick.
    """

    def __init__(self, of: Set, sliding: Array, along: Sequence[Array | None]) -> None:
        n, self.columns, self.bounds = len(of.weight), list[Array](), list[tuple[float, float]]()
        self.cones: list[tuple[int, int, float]] = []
        for i in np.flatnonzero(~sliding):
            static, support = float(of.dry[1, i]), of.supports[i]
            high, low = np.inf if support > 0 else static, -np.inf if support < 0 else -static
            if static or support:
                self._add(np.eye(n)[:, [i]], (low, high))
        for row in of.rows:
            self._add(row[:, None], (-np.inf, np.inf))
        for cone, motion in zip(of.cones, along, strict=True):
            self._add_contact(cone, motion)

    def _add(self, columns: Array, bounds: tuple[float, float]) -> None:
        self.columns += list(columns.T)
        self.bounds += [bounds] * columns.shape[1]

    def _add_contact(self, cone: Cone, motion: Array | None) -> None:
        if motion is None:
            self.cones.append((len(self.columns), cone.columns.shape[1], cone.static))
            self._add(cone.columns[:, :1], (0.0, np.inf))
            self._add(cone.columns[:, 1:], (-np.inf, np.inf))
        elif motion[0] == 0.0:
            way = motion[1:] / np.linalg.norm(motion[1:])
            ray = cone.columns[:, 0] - cone.friction * cone.columns[:, 1:] @ way
            self._add(ray[:, None], (0.0, np.inf))

    def solved(self, cost: Array, B: Array, wanted: Array, slack: Array | None = None) -> Array:
        """Least cost x of (reactions, more unknowns) with B x = wanted (or within a slack)."""
        n, count = len(wanted), len(cost)
        bounds = self.bounds + [(0.0, MOST)] * (count - len(self.bounds))
        cuts: list[Array] = [cut for cone in self.cones for cut in self._first(*cone, count)]
        equal: dict[str, Array] = {"A_eq": B, "b_eq": wanted}
        rows = np.zeros((0, count))
        if slack is not None:
            last = np.outer(slack, np.eye(count)[-1])
            rows, equal = np.vstack([B - last, -B - last]), {}
        for _ in range(CUTS):
            upper = np.vstack([rows, *cuts])
            right = np.zeros(len(upper))
            if slack is not None:
                right[: 2 * n] = np.r_[wanted, -wanted]
            solution = linprog(
                cost, A_ub=upper, b_ub=right, bounds=bounds, method="highs", options=EXACT, **equal
            )
            if solution.status == 3 or solution.x is None:
                return np.full(count, np.nan)
            more = [cut for cone in self.cones for cut in self._cut(*cone, solution.x)]
            if not more:
                break
            cuts += more
        x: Array = solution.x
        return x

    def _first(self, at: int, size: int, mu: float, count: int) -> list[Array]:
        """The cone in the plane, or eight half-spaces that contain it."""
        angles = np.pi * np.arange(2) if size == 2 else np.pi / 4 * np.arange(8)
        return [self._half_space(at, size, mu, angle, count) for angle in angles]

    def _cut(self, at: int, size: int, mu: float, x: Array) -> list[Array]:
        t = x[at + 1 : at + size]
        if size == 2 or np.hypot(*t) <= mu * x[at] * (1 + OUTSIDE) + 1e-12:
            return []
        return [self._half_space(at, size, mu, float(np.arctan2(t[1], t[0])), len(x))]

    @staticmethod
    def _half_space(at: int, size: int, mu: float, angle: float, count: int) -> Array:
        cut = np.zeros(count)
        cut[at], cut[at + 1] = -mu, np.cos(angle)
        if size == 3:
            cut[at + 2] = np.sin(angle)
        return cut


def limit(of: Set) -> float:
    """Factor of the load at which the set gives way; NaN if it does not hold without, or jams."""
    forces = Forces(of, np.zeros(len(of.weight), dtype=bool), [None] * len(of.cones))
    nothing = np.zeros(len(forces.columns))
    B = np.column_stack([*forces.columns, of.along])
    least, most = (
        float(forces.solved(np.r_[nothing, cost], B, -of.weight - of.base)[-1])
        for cost in (1.0, -1.0)
    )
    return most if least < 1e-9 and 1e-3 < most < 0.99 * MOST else float("nan")


def lacking(of: Set, factor: float, M: Array, a: Array) -> float:
    """How far accelerations are from obeying the laws under a load, relative to its forces.

    What moves must slide at its sliding level, what opens transmit nothing, and the rest hold.
    """
    still = STILL * max(1.0, float(abs(a).max()))
    dry = (of.dry[1] > 0.0) | (of.supports != 0.0)
    sliding = dry & (abs(a) > still)
    along: list[Array | None] = []
    wrong = float(np.maximum(-of.supports * a, 0.0).max(initial=0.0))
    for cone in of.cones:
        motion = cone.columns.T @ a
        wrong = max(wrong, -motion[0])
        motion[0] = motion[0] if motion[0] > still else 0.0
        rests = motion[0] == 0.0 and np.linalg.norm(motion[1:]) <= still
        along.append(None if rests else motion)
    forces = Forces(of, sliding | ~dry, along)
    count = len(forces.columns)
    load = of.weight + of.base + factor * of.along - sliding * np.sign(a) * of.dry[0]
    size = max(1.0, float(abs(load).max()))
    B = np.column_stack([*forces.columns, np.zeros_like(a)])
    cost = np.r_[np.zeros(count), 1.0]
    off = forces.solved(cost, B, M @ a - load, np.full(len(a), 1.0))[-1]
    return float(np.nan_to_num(off, nan=np.inf)) / size + wrong / max(1.0, float(abs(a).max()))
