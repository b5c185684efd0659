# SPDX-License-Identifier: Apache-2.0
"""Whether a fit predicts torques that it was not fitted to worse than the nominal scene."""

from __future__ import annotations

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Mask
from arm_studies.identification.regression.fit import Fit

# Largest and smallest number of blocks of the part held out, and length of a block in periods of
# the band, where the part is long enough: filtered noise is correlated over half a period.
BLOCKS, FEWEST, PERIODS = 20, 5, 2.0


def excess(fit: Fit, judged: Mask, nominal: Array) -> float:
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
        judged: Rows that are compared, shape (k, n).
        nominal: Torques of the nominal scene, shape (k, n).

    Returns:
        Positive if the fit is worse; zero if there is nothing to compare.
    """
    rows = fit.rows
    worse = (rows.effort - fit.drives) ** 2 - (rows.effort - nominal) ** 2
    each = np.where(judged, worse, 0.0).sum(axis=1)[judged.any(axis=1)]
    period = 1.0 if not np.isfinite(rows.band) else 1.0 / (rows.band * rows.motions[0].dt)
    count = max(FEWEST, min(BLOCKS, int(len(each) / (PERIODS * period))))
    if len(each) < count:
        return 0.0
    means = np.array([block.mean() for block in np.array_split(each, count)])
    expected, spread = _loss(fit, judged)
    error = float(np.hypot(means.std(ddof=1) / np.sqrt(count), spread / len(each)))
    return float((each.mean() - expected / len(each)) / max(error, 1e-300))


def _loss(fit: Fit, judged: Mask) -> tuple[float, float]:
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
        columns.all_of(j)[judged[:, j]] @ inverse[place] for j, place in enumerate(columns.places)
    ]
    squares = np.sum([part.T @ part for part in parts], axis=0)
    return float(np.trace(squares)), float(np.sqrt(2.0) * np.linalg.norm(squares))
