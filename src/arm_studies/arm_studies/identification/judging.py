# SPDX-License-Identifier: Apache-2.0
"""How well a fit predicts what was held out, beside the nominal scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import known_names
from arm_studies.identification import checks
from arm_studies.identification.regression.estimation import Mask, deviations
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.held_out import excess
from arm_studies.identification.regression.rows import Rows, steady_friction

# Fraction of the part held out in which a joint has to move for its prediction to be judged.
MOVING = 0.2


@dataclass(frozen=True)
class Judgement:
    """Errors on the part held out; see ``Identification`` for those that have its names.

    Attributes:
        nominal: Torques of the nominal scene, shape (k, n).
        ratios: Efforts over these, by joint, 1 where unknown, shape (n,).
        excess: By how many standard errors the nominal scene is better.
        notes: What cannot be judged, and whether the nominal scene is better.
    """

    error: tuple[float, float]
    torque_error: Mapping[str, float]
    nominal_error: Mapping[str, float]
    torque_residual: Mapping[str, float]
    nominal: Array
    ratios: Array
    excess: float
    notes: list[str]


def judged(trial: Fit, ranges: Array, held_out: float) -> Judgement:
    """Judge a fit by the rows that it was not fitted to.

    Args:
        trial: Of the rows that are not held out.
        ranges: How far each joint moved without sticking in [rad] or [m], shape (n,).
        held_out: Fraction of each recording that is held out.

    Raises:
        InvalidInput: If it hardly predicts them.
    """
    rows = trial.rows.plain
    train = rows.use & rows.train[:, None]
    model, predicted = rows.regressor.model, trial.predicted(rows)
    load = rows.rigid @ rows.regressor.nominal + rows.known + rows.inertia * model.armature
    nominal = np.asarray(load + steady_friction(rows, load))
    test, notes = _shown(rows, ranges, held_out)
    sums = [
        (rows.effort[u, j] @ nominal[u, j], nominal[u, j] @ nominal[u, j])
        for j, u in enumerate(train.T)
    ]
    ratios = np.array([a / b if b > 0.0 else 1.0 for a, b in sums])
    shown = test if test.any() else train
    checks.check_explained(
        _relative(rows.effort, predicted, shown)[0], _relative(rows.effort, nominal, shown)[0],
        rows.names, ratios,
    )  # fmt: skip
    worse = excess(trial, test, trial.rows.clear(nominal))
    error, each = _relative(rows.effort, predicted, test)
    before, each_before = _relative(rows.effort, nominal, test)
    left = np.where(test.any(axis=0), deviations(rows.effort, predicted, test), np.nan).tolist()
    torque_error, nominal_error, residual = (
        dict(zip(rows.names, values, strict=True)) for values in (each, each_before, left)
    )
    if error > max(before, checks.ROUNDING):
        notes.append(
            f"the nominal scene leaves less of the part held out, {before:.3%} against "
            f"{error:.3%}; beyond what noise in the estimates explains, that is {worse:.1f} "
            "standard errors"
        )
    errors = (error, before), torque_error, nominal_error, residual
    return Judgement(*errors, nominal, ratios, worse, notes)


def _shown(rows: Rows, ranges: Array, held_out: float) -> tuple[Mask, list[str]]:
    """Rows by which the prediction of each joint is judged: none if it rests in most of them.

    Those that are held out, or all of them if none is.

    The torque of a joint at rest may be anything that static friction holds, so that its
    prediction tells nothing.
    """
    train = rows.train[:, None]
    test = train if train.all() else ~train
    known = np.count_nonzero(rows.valid & test, axis=0)
    moving = np.count_nonzero(rows.use & test, axis=0) * (ranges > checks.MOVED)
    resting = (moving < MOVING * known) & (known > 0)
    part, notes = f"the part held out (the last {held_out:.0%} of each recording)", []
    for found, why in (
        (resting, f"at rest in most of {part}; let the motion go on to the end, or cut off "
                  "what follows it"),
        (known == 0, f"without an effort in {part}"),
    ):  # fmt: skip
        names = [f"'{name}'" for name, there in zip(rows.names, found, strict=True) if there]
        if names:
            notes.append(f"no error is known of {known_names(names)}: {why}")
    return np.asarray(rows.valid & test & ~resting), notes


def _relative(measured: Array, predicted: Array, use: Mask) -> tuple[float, list[float]]:
    """Relative residual of all joints together, and of each; NaN without a row."""
    left = np.where(use, (measured - predicted) ** 2, 0.0).sum(axis=0)
    size = np.where(use, measured**2, 0.0).sum(axis=0)
    each = np.where(use.any(axis=0), np.sqrt(left / np.maximum(size, 1e-300)), np.nan)
    whole = np.sqrt(left.sum() / max(size.sum(), 1e-300)) if use.any() else np.nan
    return float(whole), each.tolist()
