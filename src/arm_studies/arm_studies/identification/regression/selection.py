# SPDX-License-Identifier: Apache-2.0
"""Selection of the friction laws of each joint by cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Belief, Mask, columns_of
from arm_studies.identification.regression.friction_columns import (
    COULOMB,
    COULOMB_SKEW,
    EXCESS,
    LINEAR,
    STEEP,
    VISCOUS,
    VISCOUS_SKEW,
    JointFit,
    Shape,
)
from arm_studies.identification.regression.rows import FOLDS, Rows

# Stribeck velocities that are tried, relative to a joint's root mean square velocity.
FALLS = np.geomspace(0.01, 1.0, 7)
# Reduction of the prediction error by which a law is accepted: relative, and in variances of the
# residual, which chance alone exceeds once in a thousand laws.
WORTH, CHANCE = 0.02, 10.0
RESOLVED = 1e-6  # Resolution of prediction errors relative to the torque.
# Largest growth of friction with the load; the scene's curve is up to half as steep again.
STEEPEST = 0.3
ROUNDS = 2


@dataclass(frozen=True)
class Candidate:
    """A column that may be selected for a joint.

    Attributes:
        kind: One of ``LINEAR``, or ``"load"``.
        shape: Its shape.
    """

    kind: str
    shape: Shape


def candidates(speed: float, load: Array) -> list[Candidate]:
    """Candidates for a joint with a root mean square velocity under torques of shape (k,)."""
    plain = Shape()
    made = [Candidate(kind, plain) for kind in (VISCOUS, COULOMB, COULOMB_SKEW, VISCOUS_SKEW)]
    made += [Candidate(EXCESS, Shape(stribeck_velocity=float(f * speed))) for f in FALLS]
    heaviest = float(abs(load).max())
    if heaviest > 0.0:
        made.append(Candidate(LOADED, Shape(heaviest=float(f"{1.1 * heaviest:.2g}"))))
    return made


LOADED = "load"


def column(rows: Rows, candidate: Candidate, j: int, load: Array) -> Array:
    """Low-pass filtered friction of a candidate for joint j with a unit coefficient, (k, 1)."""
    law = JointFit((candidate.kind,), candidate.shape)
    if candidate.kind == LOADED:
        law = JointFit((COULOMB,), replace(candidate.shape, load=1.0))
    return rows.friction(law, j, load)


def fit_of(chosen: Sequence[Candidate], coefficients: Sequence[float]) -> JointFit:
    """The sum of candidates with these coefficients as one friction law."""
    values = {c.kind: float(x) for c, x in zip(chosen, coefficients, strict=True)}
    fall = next((c.shape.stribeck_velocity for c in chosen if c.kind == EXCESS), None)
    heaviest = next((c.shape.heaviest for c in chosen if c.kind == LOADED), 1.0)
    kinds = tuple(kind for kind in LINEAR if kind in values)
    if LOADED not in values:
        return JointFit(kinds, Shape(fall), {kind: values[kind] for kind in kinds})
    grows, stays = values[LOADED], values.get(COULOMB, 0.0)
    share = float(np.clip(grows / (grows + stays), 0.02, STEEP)) if grows > 0.0 else 0.02
    values[COULOMB] = max(grows + stays, 0.0)
    return JointFit(kinds, Shape(fall, share, heaviest), {kind: values[kind] for kind in kinds})


class Choice:
    """Forward selection of laws joint by joint, by prediction errors over ``FOLDS`` folds.

    Sums of products of all candidate columns are computed once, so that every selection is a small
    system of equations.

    Args:
        rows: The regression's rows.
        use: Rows that are used in the fit, shape (k, n).
        common: Columns of bodies and armatures; see ``common_columns``.
        belief: Prior of bodies, for all unknowns before friction.
        load: Torques of the drives, shape (k, n).
        offered: Kinds to select from; None for all.
    """

    def __init__(
        self, rows: Rows, use: Mask, common: Any, belief: Belief, load: Array,
        offered: Sequence[str] | None = None,
    ) -> None:  # fmt: skip
        self._rows, self._belief, self._target = rows, belief, rows.effort - rows.known
        self._use = use
        speeds = np.sqrt((rows.v**2).mean(axis=0))
        self.offered = [
            [c for c in candidates(speeds[j], load[:, j]) if offered is None or c.kind in offered]
            for j in range(rows.n)
        ]
        own = [
            np.hstack([column(rows, c, j, load[:, j]) for c in offer])
            for j, offer in enumerate(self.offered)
        ]
        self._columns = columns_of(common, own)
        self._first, self._precision = len(belief.x0), belief.rows.T @ belief.rows
        starts = np.cumsum([self._first, *(len(offer) for offer in self.offered)])
        self._starts = starts.tolist()
        self._sums = [self._products(fold) for fold in range(FOLDS)]
        self._total = sum((s for s in self._sums), np.zeros_like(self._sums[0]))
        self.chosen = [
            {self._starts[j] + i for i, c in enumerate(offer) if c.kind in (VISCOUS, COULOMB)}
            for j, offer in enumerate(self.offered)
        ]
        self._refused = [0.0] * rows.n  # growth that would predict better, but is too steep

    def _products(self, fold: int) -> Array:
        """Products of columns and effort of each joint over one fold, (n, size + 1, size + 1)."""
        rows, size = self._rows, self._columns.size
        found = np.zeros((rows.n, size + 1, size + 1))
        for j, place in enumerate(self._columns.places):
            part = self._columns.all_of(j)
            use = self._use[:, j] & (rows.fold == fold)
            all_columns = np.column_stack([part[use], self._target[use, j]])
            where = np.append(place, size)
            found[j][np.ix_(where, where)] = all_columns.T @ all_columns
        return found * rows.independent

    def run(self) -> list[JointFit]:
        """Select the laws of each joint."""
        weights = self._weights()
        for _ in range(ROUNDS):
            before = [set(chosen) for chosen in self.chosen]
            for j in range(self._rows.n):
                self._extend(j, weights)
            weights = self._weights()
            if before == self.chosen:
                break
        x = self._solve(self._total, weights, self._all())
        found = []
        for j, chosen in enumerate(self.chosen):
            places = sorted(chosen)
            own = [self.offered[j][place - self._starts[j]] for place in places]
            fit = fit_of(own, x[places].tolist())
            found.append(replace(fit, refused=self._refused[j]))
        return found

    def _weights(self) -> Array:
        """Of each joint: 1 over the variance of its residual, shape (n,)."""
        n, size = self._rows.n, self._columns.size
        energy = np.array([self._total[j][size, size] for j in range(n)])
        weights = 1.0 / np.maximum(energy, 1e-300)
        counts = self._use.sum(axis=0) * self._rows.independent
        for _ in range(4):
            x = self._solve(self._total, weights, self._all())
            left = np.array([_error(self._total[j], x) for j in range(n)])
            weights = np.maximum(counts, 1.0) / np.maximum(left, RESOLVED**2 * energy + 1e-300)
        return np.asarray(weights)

    def _all(self) -> list[int]:
        return [*range(self._first), *sorted(set().union(*self.chosen))]

    def _solve(self, sums: Array, weights: Array, places: list[int]) -> Array:
        size = self._columns.size
        whole = np.tensordot(weights, sums, axes=1)
        H = whole[:size, :size]
        H[: self._first, : self._first] += self._precision
        g = whole[:size, size].copy()
        g[: self._first] += self._precision @ self._belief.x0
        H, g = H[np.ix_(places, places)], g[places]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
        small = H * np.outer(scale, scale) + 1e-13 * np.eye(len(places))
        x = np.zeros(size)
        x[places] = scale * np.linalg.solve(small, scale * g)
        return x

    def _scores(self, j: int, weights: Array) -> tuple[Array, bool, float]:
        """Weighted errors of each fold predicted from the others, and whether laws are possible.

        Friction must not fall under load, nor below zero towards rest, nor grow too steeply; also
        its steepest growth is returned.
        """
        places, found, possible, growth = self._all(), [], True, 0.0
        for sums in self._sums:
            x = self._solve(self._total - sums, weights, places)
            errors = [w * _error(s, x) for w, s in zip(weights, sums, strict=True)]
            found.append(sum(errors))
            allowed, grows = self._possible(j, x)
            possible, growth = possible and allowed, max(growth, grows)
        return np.array(found), possible and growth <= STEEPEST, growth

    def _possible(self, j: int, x: Array) -> tuple[bool, float]:
        """Whether friction is nowhere negative, and its growth with the load."""
        own = {(c := self.offered[j][p - self._starts[j]]).kind: (x[p], c) for p in self.chosen[j]}
        grows, heaviest = 0.0, 1.0
        if LOADED in own:
            grows, heaviest = own[LOADED][0], own[LOADED][1].shape.heaviest
        level = own[COULOMB][0] + grows
        excess = own[EXCESS][0] if EXCESS in own else 0.0
        return bool(grows >= 0.0 and excess >= -STEEP * max(level, 0.0)), float(grows / heaviest)

    def _extend(self, j: int, weights: Array) -> None:
        """Add laws to a joint one by one as long as they reduce the prediction error."""
        best, *_ = self._scores(j, weights)
        # The other joints add the same errors, so the gain is measured against this joint's.
        least = max(WORTH * self._use[:, j].sum() * self._rows.independent, CHANCE)
        while True:
            taken = {self.offered[j][p - self._starts[j]].kind for p in self.chosen[j]}
            found: tuple[float, int, Array] | None = None
            self._refused[j] = 0.0
            for place in range(self._starts[j], self._starts[j + 1]):
                kind = self.offered[j][place - self._starts[j]].kind
                if kind in taken:
                    continue
                self.chosen[j].add(place)
                scores, possible, growth = self._scores(j, weights)
                self.chosen[j].remove(place)
                worth = best.sum() - scores.sum() > least
                better = np.count_nonzero(scores < best) >= FOLDS - 1
                if kind == LOADED and growth > STEEPEST and better and worth:
                    self._refused[j] = growth
                if possible and better and (found is None or scores.sum() < found[0]):
                    found = float(scores.sum()), place, scores
            if found is None or not best.sum() - found[0] > least:
                return
            best = found[2]
            self.chosen[j].add(found[1])


def _error(sums: Array, x: Array) -> float:
    """Sum of squares of y - A x from sums of products."""
    full = np.append(x, -1.0)
    return max(float(full @ sums @ full), 0.0)
