# SPDX-License-Identifier: Apache-2.0
"""The bandwidth of the efforts, where they contain less of the motion than the positions do.

Robots low-pass filter efforts before they report them, and predictions at high frequencies may be
position noise. In both cases efforts are explained better by predictions that are filtered more.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from arm_dynamics.arrays import Array
from arm_studies.identification.regression.estimation import Mask, deviations
from arm_studies.identification.regression.fit import Fit
from arm_studies.identification.regression.rows.rows import Rows
from arm_studies.identification.regression.rows.samples import Samples
from arm_studies.identification.signals.cutoff import PASSBAND_RATIO

# Ratio of neighbouring bandwidths that are tried, and the smallest relative to the band.
STEP, NARROWEST = 0.9, 0.06
IMPROVEMENT = 0.95  # Relative residual that a bandwidth must reach to be accepted.
ROUNDS = 8  # Largest number of fits until the bandwidth is stable.
# Fraction of the residual's power above that frequency for which the band is narrowed to it.
NOISE_FRACTION = 0.05
NEIGHBOURS = 3  # Bands that must agree on it, since the power in one of them scatters.


def with_bandwidth(fit: Fit) -> Fit:
    """The fit with the bandwidth of the efforts that explains them best.

    Each bandwidth of a geometric grid is tried on the predictions of the fit, which is then
    repeated with the best one, until that does not change. The given fit is returned if no
    bandwidth is better by ``IMPROVEMENT``.
    """
    rows, use = fit.rows, fit.problem.use
    if not np.isfinite(rows.samples.band):
        return fit
    least = mean_residual(fit.residual, use) * (IMPROVEMENT if rows.effort_band is None else 1.0)
    plain, tried = rows.low_passed(None), {rows.effort_band}
    for _ in range(ROUNDS):
        band = _best_band(fit, plain)
        if band in tried:
            break
        tried.add(band)
        trial = fit.refitted(rows=rows.low_passed(band))
        error = mean_residual(trial.residual, use)
        if not error < least:
            break
        fit, least = trial, error
    return fit


def _best_band(fit: Fit, rows: Rows) -> float | None:
    """The bandwidth at which predictions of a fit are best; None if filtering does not help."""
    predicted, use, bands = fit.predicted(rows), fit.problem.use, _grid(rows.samples)
    narrowed = (rows.samples.smoothed(predicted, band) for band in bands)
    errors = [mean_residual(rows.effort - efforts, use) for efforts in narrowed]
    best = int(np.argmin(errors))
    return bands[best] if errors[best] < mean_residual(rows.effort - predicted, use) else None


def mean_residual(residual: Array, use: Mask) -> float:
    """Geometric mean over joints of a residual, which does not depend on units."""
    return float(np.exp(np.log(_size(residual, use)).mean()))


def noise_frequency(rows: Rows, use: Mask, residual: Array) -> float | None:
    """The frequency in [Hz] above which efforts contain more noise than motion, with a margin.

    It is the lower edge of the lowest ``NEIGHBOURS`` neighbouring bands of the grid in each of
    which the motion has less power than the noise. None if that is above the band, or if the
    efforts have hardly any noise there.
    """
    samples = rows.samples
    if not np.isfinite(samples.band):
        return None
    whole = _size(residual, use)

    def above(values: Array, band: float) -> float:
        """Power above a frequency, relative to the residual's."""
        return float(np.mean((_size(values - samples.smoothed(values, band), use) / whole) ** 2))

    grid = _grid(samples)
    parts = rows.effort - residual, residual
    signal, noise = (np.array([above(part, band) for band in grid]) for part in parts)
    less = np.diff(signal) < np.diff(noise)
    noisy = np.flatnonzero(sliding_window_view(less, NEIGHBOURS).all(axis=1))
    if not noisy.size:
        return None
    limit = float(PASSBAND_RATIO * grid[noisy[-1] + NEIGHBOURS])
    kept = float(np.mean((_size(samples.smoothed(residual, limit), use) / whole) ** 2))
    return limit if limit < samples.band and 1.0 - kept > NOISE_FRACTION else None


def _size(values: Array, use: Mask) -> Array:
    return deviations(values, np.zeros_like(values), use)


def _grid(samples: Samples) -> list[float]:
    """Bandwidths, from the band downwards."""
    count = int(np.log(NARROWEST) / np.log(STEP))
    return [samples.band * STEP**k for k in range(1, count + 1)]
