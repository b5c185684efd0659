# SPDX-License-Identifier: Apache-2.0
"""How well a fit predicts what was held out, beside the nominal scene."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import known_names
from arm_studies.identification import checks
from arm_studies.identification.regression.estimation import Mask, deviations
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.rows.rows import Rows, nominal_efforts

# Fraction of the part held out in which a joint has to move for its prediction to be judged.
MOVING_FRACTION = 0.2
# Largest and smallest number of blocks of the part held out, and length of a block in periods of
# the band, where the part is long enough: filtered noise is correlated over half a period.
BLOCKS, FEWEST, PERIODS = 20, 5, 2.0


class Errors(NamedTuple):
    """Relative errors of the torques that two scenes predict; NaN if unknown."""

    identified: float
    nominal: float


@dataclass(frozen=True)
class Validation:
    """Errors on the part held out.

    Attributes:
        error: Of all joints together.
        joints: Of each joint.
        residuals: Root mean square of what is left of each joint's torque in [N m] or [N].
        nominal: Torques of the nominal scene, shape (k, n).
        ratios: Efforts over torques of the nominal scene, by joint, 1 where unknown, shape (n,).
        excess: By how many standard errors the nominal scene is better.
        notes: What cannot be judged, and whether the nominal scene is better.
    """

    error: Errors
    joints: list[Errors]
    residuals: list[float]
    nominal: Array
    ratios: Array
    excess: float
    notes: list[str]


def validate(trial: Fit, ranges: Array, held_out: float) -> Validation:
    """Compare a fit and the nominal scene by the rows that it was not fitted to.

    Args:
        trial: Of the rows that are not held out.
        ranges: How far each joint moved without sticking in [rad] or [m], shape (n,).
        held_out: Fraction of each recording that is held out.

    Raises:
        InvalidInput: If it hardly predicts them.
    """
    rows = trial.rows.unwhitened
    train = rows.samples.use & rows.samples.train[:, None]
    predicted = trial.predicted(rows)
    nominal = nominal_efforts(rows)
    test, notes = _test_rows(rows, ranges, held_out)
    pairs = [(rows.effort[use, j], nominal[use, j]) for j, use in enumerate(train.T)]
    ratios = np.array([y @ x / (x @ x) if x @ x > 0.0 else 1.0 for y, x in pairs])
    shown = test if test.any() else train
    checks.check_explained(
        _relative(rows.effort, predicted, shown)[0], _relative(rows.effort, nominal, shown)[0],
        rows.samples.names, ratios,
    )  # fmt: skip
    worse = excess(trial, test, trial.rows.whiten(nominal))
    error, each = _relative(rows.effort, predicted, test)
    before, each_before = _relative(rows.effort, nominal, test)
    residuals = np.where(test.any(axis=0), deviations(rows.effort, predicted, test), np.nan)
    if error > max(before, checks.ROUNDING):
        within = "within" if worse <= checks.STANDARD_ERRORS else "beyond"
        notes.append(
            f"the nominal scene predicts the part held out better, {before:.3%} against "
            f"{error:.3%}; {within} what noise in the estimates explains"
        )
    return Validation(
        error=Errors(error, before), joints=[*map(Errors, each, each_before)], notes=notes,
        residuals=residuals.tolist(), nominal=nominal, ratios=ratios, excess=worse,
    )  # fmt: skip


def _test_rows(rows: Rows, ranges: Array, held_out: float) -> tuple[Mask, list[str]]:
    """Rows by which the prediction of each joint is judged: none if it rests in most of them.

    Those that are held out, or all of them if none is.

    The torque of a joint at rest may be anything that static friction holds, so that its
    prediction tells nothing.
    """
    train = rows.samples.train[:, None]
    test = train if train.all() else ~train
    count = np.count_nonzero(rows.samples.valid & test, axis=0)
    moving = np.count_nonzero(rows.samples.use & test, axis=0) * (ranges > checks.LEAST_RANGE)
    resting = (moving < MOVING_FRACTION * count) & (count > 0)
    part, notes = f"the part held out (the last {held_out:.0%} of each recording)", []
    for affected, why in (
        (resting, f"at rest in most of {part}; let the motion go on to the end, or cut off "
                  "what follows it"),
        (count == 0, f"without an effort in {part}"),
    ):  # fmt: skip
        if names := [f"'{rows.samples.names[j]}'" for j in np.flatnonzero(affected)]:
            notes.append(f"no error is known of {known_names(names)}: {why}")
    return np.asarray(rows.samples.valid & test & ~resting), notes


def _relative(measured: Array, predicted: Array, use: Mask) -> tuple[float, list[float]]:
    """Relative residual of all joints together, and of each; NaN without a row."""
    error = np.where(use, (measured - predicted) ** 2, 0.0).sum(axis=0)
    size = np.where(use, measured**2, 0.0).sum(axis=0)
    each = np.where(use.any(axis=0), np.sqrt(error / np.maximum(size, 1e-300)), np.nan)
    whole = np.sqrt(error.sum() / max(size.sum(), 1e-300)) if use.any() else np.nan
    return float(whole), each.tolist()


def excess(fit: Fit, use: Mask, nominal: Array) -> float:
    """How much worse a fit predicts than the nominal scene, in standard errors.

    Squared residuals of both are compared in pairs, which is sharp, since they share their noise
    (Diebold, Mariano, "Comparing predictive accuracy", J. Business & Economic Statistics 13(3),
    1995). Estimates from noisy data predict a little worse than a scene that is exact; what they
    lose is expected from their covariance and does not count (the correction of Clark, West,
    "Approximately normal tests for equal predictive accuracy in nested models", J. Econometrics
    138(1), 2007, with its expected value). Residuals are correlated in time, so that the standard
    error is that of means of consecutive blocks, together with the spread of that loss.

    Args:
        fit: Of other rows.
        use: Rows that are compared, shape (k, n).
        nominal: Torques of the nominal scene, shape (k, n).

    Returns:
        Positive if the fit is worse; zero if there is nothing to compare.
    """
    rows = fit.rows
    worse = (rows.effort - fit.drives) ** 2 - (rows.effort - nominal) ** 2
    each = np.where(use, worse, 0.0).sum(axis=1)[use.any(axis=1)]
    per_row = rows.samples.band * rows.samples.motions[0].dt
    period = 1.0 / per_row if np.isfinite(per_row) else 1.0
    count = max(FEWEST, min(BLOCKS, int(len(each) / (PERIODS * period))))
    if len(each) < count:
        return 0.0
    means = np.array([block.mean() for block in np.array_split(each, count)])
    expected, spread = _loss(fit, use)
    error = float(np.hypot(means.std(ddof=1) / np.sqrt(count), spread / len(each)))
    return float((each.mean() - expected / len(each)) / max(error, 1e-300))


def _loss(fit: Fit, use: Mask) -> tuple[float, float]:
    """Sum of squares of errors of predictions that noise in the estimates causes.

    Returns:
        Its mean and its standard deviation, by the covariance of normal estimates.
    """
    columns, _ = fit.with_shapes
    R, _ = fit.problem.combined(columns, fit.weights)
    size = np.linalg.norm(R, axis=0)
    size[size == 0.0] = 1.0
    inverse = np.linalg.pinv(R / size, rcond=1e-14) / size[:, None]
    parts = [
        columns.all_of(j)[use[:, j]] @ inverse[place] for j, place in enumerate(columns.places)
    ]
    squares = np.sum([part.T @ part for part in parts], axis=0)
    return float(np.trace(squares)), float(np.sqrt(2.0) * np.linalg.norm(squares))
