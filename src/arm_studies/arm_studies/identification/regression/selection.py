# SPDX-License-Identifier: Apache-2.0
"""Selection of the friction laws of each joint by cross-validation."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression import friction
from arm_studies.identification.regression.estimation import Columns, Mask
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.friction import COULOMB, EXCESS, JointFit, Shape
from arm_studies.identification.regression.rows.samples import FOLDS

# Stribeck velocities that are tried, relative to a joint's root mean square velocity.
SPEEDS = np.geomspace(0.01, 1.0, 7)
# Reduction of the prediction error by which a law is accepted: relative, and in variances of the
# residual, which chance alone exceeds once in a thousand laws.
LEAST_GAIN, LEAST_VARIANCES = 0.02, 10.0
RESOLUTION = 1e-6  # Resolution of prediction errors relative to the torque.
ROUNDS = 2  # Over all joints, since weights depend on the laws of the others.
INITIAL_KINDS = (friction.VISCOUS, COULOMB)  # Kinds that every joint begins with.


class Candidate(NamedTuple):
    """A column of a joint that may be selected, of a kind of ``friction.LINEAR`` or ``LOAD``.

    ``LOAD`` is friction that grows with the load.
    """

    joint: int
    kind: str
    shape: Shape


def select_laws(fit: Fit) -> list[JointFit]:
    """The laws of each joint that predict best, under the loads of a fit."""
    return _Selection(fit).run()


def _candidates(j: int, speed: float, load: Array) -> list[Candidate]:
    """Candidates of a joint with a root mean square velocity under torques of shape (k,)."""
    candidates = [Candidate(j, kind, Shape()) for kind in friction.LINEAR if kind != EXCESS]
    candidates += [Candidate(j, EXCESS, Shape(stribeck_velocity=float(f * speed))) for f in SPEEDS]
    largest = float(abs(load).max())
    if largest > 0.0:
        growing = Shape(heaviest=float(f"{1.1 * largest:.2g}"))
        candidates.append(Candidate(j, friction.LOAD, growing))
    return candidates


def _law(chosen: Sequence[Candidate], coefficients: Sequence[float], steepness: float) -> JointFit:
    """The sum of candidates with these coefficients as one friction law."""
    values = {c.kind: float(x) for c, x in zip(chosen, coefficients, strict=True)}
    shapes = {c.kind: c.shape for c in chosen}
    shape = shapes.get(EXCESS, Shape())
    if friction.LOAD in values:
        grows, stays = values[friction.LOAD], values.get(COULOMB, 0.0)
        share = grows / (grows + stays) if grows > 0.0 else 0.0
        share = float(np.clip(share, 0.02, friction.LARGEST_SHARE))
        shape = replace(shape, load=share, heaviest=shapes[friction.LOAD].heaviest)
        values[COULOMB] = max(grows + stays, 0.0)
    kinds = tuple(kind for kind in friction.LINEAR if kind in values)
    return JointFit(kinds, shape, {kind: values[kind] for kind in kinds}, steepness)


class _Selection:
    """Forward selection of laws joint by joint, by prediction errors over ``FOLDS`` folds.

    Sums of products of all candidate columns are computed once, so that every selection is a small
    system of equations.
    """

    def __init__(self, fit: Fit) -> None:
        problem, rows = fit.problem, fit.rows
        speeds = np.sqrt((rows.samples.v**2).mean(axis=0))
        offered = [_candidates(j, speeds[j], fit.drives[:, j]) for j in range(rows.samples.n)]
        own = []
        for j, offer in enumerate(offered):
            laws = [
                JointFit((COULOMB,), replace(c.shape, load=1.0)) if c.kind == friction.LOAD
                else JointFit((c.kind,), c.shape) for c in offer
            ]  # fmt: skip
            own.append(np.hstack([rows.friction(law, j, fit.drives[:, j]) for law in laws]))
        self.columns = Columns.of(problem.common, own)
        self.first = self.columns.size - sum(map(len, offered))
        flat = [c for offer in offered for c in offer]
        self.candidates = dict(enumerate(flat, self.first))
        self.chosen = {place for place, c in self.candidates.items() if c.kind in INITIAL_KINDS}
        self.steepness = [0.0] * rows.samples.n  # that would predict better, but is too large
        self.counts = problem.use.sum(axis=0) * rows.samples.independent
        self.sums = [self._products(fit, rows.samples.fold == fold) for fold in range(FOLDS)]
        self.total = sum((s for s in self.sums), np.zeros_like(self.sums[0]))
        S = problem.prior.rows
        self.precision, self.x0 = S.T @ S, problem.prior.x0

    def _products(self, fit: Fit, fold: Mask) -> Array:
        """Products of columns and effort of each joint over one fold, (n, size + 1, size + 1)."""
        size = self.columns.size
        products = np.zeros((fit.rows.samples.n, size + 1, size + 1))
        for j, place in enumerate(self.columns.places):
            use = fit.problem.use[:, j] & fold
            table = np.column_stack([self.columns.all_of(j)[use], fit.problem.target[use, j]])
            places = np.ix_(*[np.append(place, size)] * 2)
            products[j][places] = table.T @ table
        return products * fit.rows.samples.independent

    def run(self) -> list[JointFit]:
        """Select the laws of each joint."""
        weights = self._weights()
        for _ in range(ROUNDS):
            before = set(self.chosen)
            for j in range(len(self.steepness)):
                self._extend(j, weights)
            weights = self._weights()
            if before == self.chosen:
                break
        x, laws = self._solve(self.total, weights), []
        for j, steepness in enumerate(self.steepness):
            places = self._places(j)
            own = [self.candidates[place] for place in places]
            laws.append(_law(own, x[places].tolist(), steepness))
        return laws

    def _places(self, j: int) -> list[int]:
        """Places of what is chosen for a joint."""
        return [place for place in sorted(self.chosen) if self.candidates[place].joint == j]

    def _weights(self) -> Array:
        """Of each joint: 1 over the variance of its residual, shape (n,)."""
        energy = self.total[:, -1, -1]
        weights = 1.0 / np.maximum(energy, 1e-300)
        for _ in range(4):
            x = self._solve(self.total, weights)
            errors = np.array([_error(sums, x) for sums in self.total])
            errors = np.maximum(errors, RESOLUTION**2 * energy + 1e-300)
            weights = np.maximum(self.counts, 1.0) / errors
        return np.asarray(weights)

    def _solve(self, sums: Array, weights: Array, tried: Iterable[int] = ()) -> Array:
        """Least squares of what is chosen and, for a trial, of what is tried."""
        size, bodies = self.columns.size, len(self.x0)
        places = [*range(self.first), *sorted(self.chosen.union(tried))]
        whole = np.tensordot(weights, sums, axes=1)
        H, g = whole[:size, :size], whole[:size, size].copy()
        H[:bodies, :bodies] += self.precision
        g[:bodies] += self.precision @ self.x0
        H, g = H[np.ix_(places, places)], g[places]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(H), 1e-300))
        small = H * np.outer(scale, scale) + 1e-13 * np.eye(len(places))
        x = np.zeros(size)
        x[places] = scale * np.linalg.solve(small, scale * g)
        return x

    def _scores(
        self, j: int, weights: Array, tried: Sequence[int] = ()
    ) -> tuple[Array, bool, float]:
        """Weighted errors of each fold predicted from the others, and whether laws are possible.

        Friction must not fall under load, nor below zero towards rest, nor grow too steeply; also
        its steepest growth is returned.
        """
        places, totals, is_possible, growth = [*self._places(j), *tried], [], True, 0.0
        shapes = {self.candidates[p].kind: self.candidates[p].shape for p in places}
        for sums in self.sums:
            x = self._solve(self.total - sums, weights, tried)
            errors = [w * _error(s, x) for w, s in zip(weights, sums, strict=True)]
            totals.append(sum(errors))
            own = {self.candidates[p].kind: float(x[p]) for p in places}
            grows = own.get(friction.LOAD, 0.0)
            level = own[COULOMB] + grows
            is_possible &= grows >= 0.0
            is_possible &= own.get(EXCESS, 0.0) >= -friction.LARGEST_SHARE * max(level, 0.0)
            growth = max(growth, grows / shapes[friction.LOAD].heaviest if grows else 0.0)
        return np.array(totals), is_possible and growth <= friction.LARGEST_GROWTH, growth

    def _extend(self, j: int, weights: Array) -> None:
        """Add laws to a joint one by one as long as they reduce the prediction error."""
        best, *_ = self._scores(j, weights)
        # The other joints add the same errors, so the gain is measured against this joint's.
        least = max(LEAST_GAIN * self.counts[j], LEAST_VARIANCES)
        while True:
            kinds = {self.candidates[place].kind for place in self._places(j)}
            pick: tuple[int, Array] | None = None
            self.steepness[j] = 0.0
            for place, (joint, kind, _) in self.candidates.items():
                if joint != j or kind in kinds:
                    continue
                scores, is_possible, growth = self._scores(j, weights, [place])
                is_better = np.count_nonzero(scores < best) >= FOLDS - 1
                is_steep = kind == friction.LOAD and growth > friction.LARGEST_GROWTH
                if is_steep and is_better and best.sum() - scores.sum() > least:
                    self.steepness[j] = growth
                if is_possible and is_better and (pick is None or scores.sum() < pick[1].sum()):
                    pick = place, scores
            if pick is None or not best.sum() - pick[1].sum() > least:
                return
            place, best = pick
            self.chosen.add(place)


def _error(sums: Array, x: Array) -> float:
    """Sum of squares of y - A x from sums of products."""
    full = np.append(x, -1.0)
    return max(float(full @ sums @ full), 0.0)
