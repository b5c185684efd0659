# SPDX-License-Identifier: Apache-2.0
"""The bandwidth of the efforts, where they contain less of the motion than the positions do.

Robots low-pass filter efforts before they report them, and predictions at high frequencies may be
position noise. In both cases efforts are explained better by predictions that are filtered more.
"""

from __future__ import annotations

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.filtering import FLAT
from arm_studies.identification.regression.estimation import Mask, deviations
from arm_studies.identification.regression.fit import Fit, fitted
from arm_studies.identification.regression.rows import Rows

# Ratio of neighbouring bandwidths that are tried, and the smallest relative to the band.
STEP, NARROWEST = 0.9, 0.06
BETTER = 0.95  # Relative residual that a bandwidth must reach to be accepted.
ROUNDS = 8  # Largest number of fits until the bandwidth is stable.
# Fraction of the residual's power above that frequency for which the band is narrowed to it.
NOISY = 0.05


def with_bandwidth(rows: Rows, use: Mask, belief_for: object, fit: Fit) -> tuple[Rows, Fit]:
    """The rows and the fit with the bandwidth of the efforts that explains them best.

    Each bandwidth of a geometric grid is tried on the predictions of the fit, which is then
    repeated with the best one, until that does not change.

    Args:
        rows: The regression's rows.
        use: Rows that are used, shape (k, n).
        belief_for: See ``fit.fitted``.
        fit: Of these rows.

    Returns:
        The given rows and fit if no bandwidth is better by ``BETTER``.
    """
    if not np.isfinite(rows.band):
        return rows, fit
    plain = rows.low_passed(None)
    best_rows, best, least = rows, fit, mean_residual(fit.residual, use)
    if rows.effort_band is None:
        least *= BETTER
    tried = {rows.effort_band}
    for _ in range(ROUNDS):
        band = _screened(plain, use, best)
        if band in tried:
            break
        tried.add(band)
        other = rows.low_passed(band)
        trial = fitted(other, use, belief_for, list(best.friction))
        error = mean_residual(trial.residual, use)
        if not error < least:
            break
        best_rows, best, least = other, trial, error
    return best_rows, best


def mean_residual(residual: Array, use: Mask) -> float:
    """Geometric mean over joints of a residual, which does not depend on units."""
    return float(np.exp(np.log(_size(residual, use)).mean()))


def noise_above(rows: Rows, use: Mask, residual: Array) -> float | None:
    """The frequency in [Hz] above which efforts contain more noise than motion, with a margin.

    None if that is above the band, or if the efforts have hardly any noise there.
    """
    if not np.isfinite(rows.band):
        return None
    whole = _size(residual, use)

    def above(values: Array) -> Array:
        """Power above each frequency of the grid, relative to the residual's."""
        parts = (values - rows.narrowed(values, band) for band in _grid(rows))
        return np.array([np.mean((_size(part, use) / whole) ** 2) for part in parts])

    signal, noise = above(rows.effort - residual), above(residual)
    less = np.diff(signal) < np.diff(noise)
    three = np.flatnonzero(less[:-2] & less[1:-1] & less[2:])
    if not three.size:
        return None
    limit = float(FLAT * _grid(rows)[three[-1] + 3])
    left = float(np.mean((_size(rows.narrowed(residual, limit), use) / whole) ** 2))
    return limit if limit < rows.band and 1.0 - left > NOISY else None


def _size(values: Array, use: Mask) -> Array:
    return deviations(values, np.zeros_like(values), use)


def _grid(rows: Rows) -> list[float]:
    """Bandwidths, from the band downwards."""
    count = int(np.log(NARROWEST) / np.log(STEP))
    return [rows.band * STEP**k for k in range(1, count + 1)]


def _screened(plain: Rows, use: Mask, fit: Fit) -> float | None:
    """The bandwidth at which the predictions of a fit are best, without another fit."""
    predicted = fit.predicted(plain)
    bands = _grid(plain)
    errors = [mean_residual(plain.effort - plain.narrowed(predicted, band), use) for band in bands]
    best = int(np.argmin(errors))
    return bands[best] if errors[best] < mean_residual(plain.effort - predicted, use) else None
