# SPDX-License-Identifier: Apache-2.0
"""The fit of one set of friction laws: bodies, armatures, coefficients and shapes of friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.estimation import (
    Belief,
    Columns,
    Mask,
    columns_of,
    common_columns,
    deviations,
    made_possible,
    solved,
)
from arm_studies.identification.regression.friction_columns import (
    COULOMB,
    COULOMB_SKEW,
    EXCESS,
    STEEP,
    VISCOUS,
    VISCOUS_SKEW,
    JointFit,
    Shape,
)
from arm_studies.identification.regression.regressor import EACH
from arm_studies.identification.regression.rows import Rows
from arm_studies.identification.regression.selection import STEEPEST

SIGNED = (COULOMB_SKEW, VISCOUS_SKEW, EXCESS)
STEPS = 25
# ``settled`` of results: then shapes are known far better than any noise lets them be.
SETTLED = 1e-6


@dataclass(frozen=True)
class Fit:
    """Result of a fit.

    Attributes:
        x: Bodies, armatures and friction, shape (size,).
        friction: Of each joint, with its coefficients.
        columns: The regression at the end.
        weights: Of each joint, shape (n,).
        residual: Shape (k, n).
        changed: Whether bodies had to be changed to be physically consistent.
    """

    x: Array
    friction: tuple[JointFit, ...]
    columns: Columns
    weights: Array
    residual: Array
    changed: bool

    @property
    def bodies(self) -> int:
        """Number of inertial parameters."""
        return self.columns.size - len(self.weights) - sum(len(f.kinds) for f in self.friction)

    def predicted(self, rows: Rows) -> Array:
        """Efforts of the same motion in rows with another bandwidth, shape (k, n)."""
        bodies, n = self.bodies, len(self.weights)
        rigid = rows.rigid @ self.x[:bodies] + rows.inertia * self.x[bodies : bodies + n]
        return np.asarray(rows.known + rigid + self.own_predicted(rows))

    def own_predicted(self, rows: Rows) -> Array:
        """The part of it that is the joints' own friction, shape (k, n)."""
        load = self.columns.predicted(self.x) + rows.known
        own = [
            rows.friction(law, j, load[:, j]) @ [law.coefficients[kind] for kind in law.kinds]
            for j, law in enumerate(self.friction)
        ]
        return np.column_stack(own)


def fitted(
    rows: Rows, use: Mask, belief_for: object, friction: Sequence[JointFit], *,
    possible: bool = False, settled: float = SETTLED,
) -> Fit:  # fmt: skip
    """Fit all unknowns: linear ones in one step, shapes of friction by Gauss-Newton.

    Args:
        rows: The regression's rows.
        use: Rows that are used, shape (k, n).
        belief_for: Returns the prior for a number of unknowns.
        friction: Laws of each joint, with first guesses of their shapes.
        possible: Whether bodies must be physically consistent.
        settled: Change of the sum of the logarithms of the joints' residuals at which shapes have
            converged.
    """
    target = rows.effort - rows.known
    common = common_columns(rows, use)
    load = np.zeros_like(target)
    fits = [_kept(rows, use, j, fit) for j, fit in enumerate(friction)]
    weights = 1.0 / deviations(target, np.zeros_like(target), use)
    fastest = abs(rows.v).max(axis=0)
    for _ in range(4):  # impossible terms are removed
        fits, load, weights, x, columns = _settled(
            rows, use, common, belief_for, fits, target, load, weights, settled
        )
        lean = [_without_impossible(fit, fastest[j]) for j, fit in enumerate(fits)]
        if all((a.kinds, a.bends) == (b.kinds, b.bends) for a, b in zip(lean, fits, strict=True)):
            break
        fits = lean
    R, z = columns.whitened(target, weights, rows.independent)
    changed = False
    if possible:
        x, changed = _possible(R, z, x, belief_for(columns.size), rows, fits)  # type: ignore[operator]
    fits = _with_coefficients(fits, x, columns.size)
    residual = target - columns.predicted(x)
    return Fit(x, tuple(fits), columns, weights, residual, changed)


def _kept(rows: Rows, use: Mask, j: int, fit: JointFit) -> JointFit:
    """The law without terms that a joint at rest, or moving one way only, cannot determine."""
    v = rows.v[use[:, j], j]
    if not v.size or np.sqrt(np.mean(v**2)) < 1e-9:
        return JointFit(())
    if (v > 0.0).all() or (v < 0.0).all():
        return JointFit(tuple(k for k in fit.kinds if k in (VISCOUS, COULOMB)), fit.shape)
    return fit


def _settled(
    rows: Rows, use: Mask, common: Any, belief_for: object, fits: list[JointFit], target: Array,
    load: Array, weights: Array, settled: float,
) -> tuple[list[JointFit], Array, Array, Array, Columns]:  # fmt: skip
    best = np.inf
    kept: tuple[list[JointFit], Array, Array, Array, Columns] | None = None
    trial, damping = fits, 1.0
    for step in range(STEPS):
        own = [rows.friction(fit, j, load[:, j]) for j, fit in enumerate(trial)]
        columns = columns_of(common, own)
        belief: Belief = belief_for(columns.size)  # type: ignore[operator]
        R, z = belief.combined(*columns.whitened(target, weights, rows.independent))
        x = solved(R, z)
        predicted = columns.predicted(x)
        left = deviations(target, predicted, use)
        cost = float(np.log(left).sum())
        trial = _with_coefficients(trial, x, columns.size)
        gain = best - cost
        if step > 4 and gain < -1e-12 and kept is not None:
            if -gain < settled:
                break
            damping *= 0.3
            if damping < 1e-2:
                break
            trial = _stepped(rows, belief_for, kept, target, damping)
            continue
        best, kept = cost, (trial, load, weights, x, columns)
        weights = 1.0 / left
        load = predicted + rows.known
        if not any(fit.bends for fit in trial):
            if step >= 3:
                break
            continue
        if step >= 3 and abs(gain) < settled:
            break
        damping = min(1.0, 2.0 * damping)
        trial = _stepped(rows, belief_for, (trial, load, weights, x, columns), target, damping)
    assert kept is not None
    return kept


def _with_coefficients(fits: Sequence[JointFit], x: Array, size: int) -> list[JointFit]:
    """The laws with the coefficients at the end of x."""
    place = size - sum(len(fit.kinds) for fit in fits)
    found = []
    for fit in fits:
        values = x[place : place + len(fit.kinds)].tolist()
        found.append(replace(fit, coefficients=dict(zip(fit.kinds, values, strict=True))))
        place += len(fit.kinds)
    return found


def _stepped(
    rows: Rows, belief_for: object,
    now: tuple[list[JointFit], Array, Array, Array, Columns], target: Array, damping: float,
) -> list[JointFit]:  # fmt: skip
    """Shapes after a Gauss-Newton step, with all linear unknowns free."""
    fits, load, weights, _, columns = now
    wide, names = _widened(rows, fits, load, columns)
    belief: Belief = belief_for(wide.size)  # type: ignore[operator]
    R, z = belief.combined(*wide.whitened(target, weights, rows.independent))
    x = solved(R, z)
    moved = list(fits)
    for i, (j, name) in enumerate(names):
        by = damping * float(np.clip(x[columns.size + i], -0.7, 0.7))
        moved[j] = replace(moved[j], shape=moved[j].shape.moved(name, by))
    return moved


def with_shapes(rows: Rows, fit: Fit) -> tuple[Columns, list[tuple[int, str]]]:
    """The regression of a fit with its shapes as more unknowns, linearized.

    Returns:
        The columns, and the joint and name of each further unknown, see ``Shape.moved``.
    """
    load = fit.columns.predicted(fit.x) + rows.known
    return _widened(rows, fit.friction, load, fit.columns)


def _widened(
    rows: Rows, fits: Sequence[JointFit], load: Array, columns: Columns
) -> tuple[Columns, list[tuple[int, str]]]:
    names = [(j, name) for j, fit in enumerate(fits) for name in fit.bends]
    parts, places = list(columns.own), list(columns.places)
    for j in dict.fromkeys(j for j, _ in names):
        parts[j] = np.column_stack([parts[j], _slopes(rows, fits[j], j, load[:, j])])
    for i, (j, _) in enumerate(names):
        places[j] = np.append(places[j], columns.size + i)
    size = columns.size + len(names)
    return replace(columns, own=tuple(parts), places=tuple(places), size=size), names


def _slopes(rows: Rows, fit: JointFit, j: int, load: Array) -> Array:
    """Derivatives of a joint's friction by the parameters of its shape, shape (k, parameters)."""
    coefficients = [fit.coefficients[kind] for kind in fit.kinds]

    def torque(shape: Shape) -> Array:
        return np.asarray(rows.sliding(replace(fit, shape=shape), j, load) @ coefficients)

    h, now, found = 1e-6, torque(fit.shape), []
    for name in fit.bends:
        shape, span = fit.shape.moved(name, h), h
        if shape == fit.shape:  # at its upper bound
            shape, span = fit.shape.moved(name, -h), -h
        if name == "load":
            span = (shape.load or 0.0) - (fit.shape.load or 0.0)
        found.append((torque(shape) - now) / span)
    return rows.filtered(np.column_stack(found), j)


def _without_impossible(fit: JointFit, fastest: float) -> JointFit:
    """The law without terms of impossible coefficients, such as negative friction.

    Args:
        fit: The law.
        fastest: Largest speed of the joint, at which friction must have changed from its level at
            rest; else the change is viscous friction.
    """
    c = fit.coefficients
    kinds = [k for k in fit.kinds if k in SIGNED or c[k] > 0.0]
    level = c.get(COULOMB, 0.0)
    if EXCESS in kinds and (
        level <= 0.0
        or c[EXCESS] < -STEEP * level
        or (fit.shape.stribeck_velocity or 0.0) > fastest
    ):  # the other terms may be possible without it
        kinds = [k for k in fit.kinds if k != EXCESS]
    for skew, mean in ((COULOMB_SKEW, COULOMB), (VISCOUS_SKEW, VISCOUS)):
        if skew in kinds and mean not in kinds and skew != COULOMB_SKEW:
            kinds.remove(skew)
    if COULOMB not in kinds and EXCESS in kinds:
        kinds.remove(EXCESS)
    shape, refused = fit.shape, fit.refused
    if EXCESS not in kinds:
        shape = replace(shape, stribeck_velocity=None)
    if shape.load is not None:
        growth = c.get(COULOMB, 0.0) * shape.steepness
        if COULOMB not in kinds or shape.load <= 0.01 or growth > STEEPEST:
            shape = replace(shape, load=None)
        if growth > STEEPEST:
            refused = growth
    return replace(fit, kinds=tuple(kinds), shape=shape, refused=refused)


def _possible(
    R: Array, z: Array, x: Array, belief: Belief, rows: Rows, fits: Sequence[JointFit]
) -> tuple[Array, bool]:
    """The estimate if it is physically consistent, else the best consistent one."""
    nominal = belief.x0[: len(rows.regressor.nominal)]
    parts = [x[i : i + EACH] for i in range(0, len(nominal), EACH) if nominal[i] > 1e-9]
    armatures = range(len(nominal), len(nominal) + rows.n)
    shown = [i for i in armatures if np.linalg.norm(R[:, i]) > 0.0]
    if all(bodies.possible(part, 1e-12) for part in parts) and all(x[i] >= 0.0 for i in shown):
        return x, False
    start = x.copy()
    for i in range(0, len(nominal), EACH):
        if nominal[i] > 1e-9:
            start[i : i + EACH] = bodies.nearest(nominal[i : i + EACH])
    first = len(nominal) + rows.n
    kinds = [kind for fit in fits for kind in fit.kinds]
    positive = [*shown, *(first + i for i, k in enumerate(kinds) if k not in SIGNED)]
    start[positive] = np.maximum(x[positive], 1e-3 * abs(x[positive]).max() + 1e-9)
    share = 1.0
    while not _inside(start + share * (x - start), nominal, positive):
        share *= 0.7
    return made_possible(
        *belief.combined(R, z), start + 0.9 * share * (x - start), nominal, positive
    ), True


def _inside(x: Array, nominal: Array, positive: Sequence[int]) -> bool:
    parts = (x[i : i + EACH] for i in range(0, len(nominal), EACH) if nominal[i] > 1e-9)
    return bool((x[list(positive)] > 0.0).all()) and all(bodies.possible(part) for part in parts)
