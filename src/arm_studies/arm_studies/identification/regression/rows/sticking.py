# SPDX-License-Identifier: Apache-2.0
"""Rows in which a joint may stick, and the torques that this can cause in others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_studies.identification.data import MeasuredMotion, runs

# Time in [s] for which a joint whose velocity is exact may be at rest, and most of the time before
# and after a reversal in which one may stick.
LONGEST_REST = 0.1
# Periods of the band before and after a joint rests or reverses in which it may stick: its
# friction has then any value up to static friction. Periods from one to the next of its values
# that are unknown there.
STICKING_PERIODS, PULSE_PERIODS = 0.3, 0.2
# Power of such a value, relative to the residual's, below which it does not matter.
LEAST_POWER = 1e-3
# Velocity relative to a joint's root mean square velocity below which it is at rest; the low-pass
# filter rings by up to 5e-3 of it when a joint sticks.
REST_VELOCITY = 1e-2


def may_stick(motion: MeasuredMotion) -> NDArray[np.bool_]:
    """Rows in which a joint may stick, shape (k, n).

    Where the velocity is filtered, as it rests or reverses, and nearby; else as it rests.
    """
    if not np.isfinite(motion.band):
        return resting(motion)
    slow = _slow(motion)
    reach = round(min(STICKING_PERIODS / motion.band, LONGEST_REST) / motion.dt)
    near = np.zeros_like(slow)
    for s in motion.stretches:
        turns = motion.v[s][1:] * motion.v[s][:-1] < 0.0
        sticks = slow[s] | np.pad(turns, ((0, 1), (0, 0))) | np.pad(turns, ((1, 0), (0, 0)))
        for j, column in enumerate(sticks.T):
            for start, end in runs(column):
                near[s][max(0, start - reach) : end + reach, j] = True
    return near


def resting(motion: MeasuredMotion) -> NDArray[np.bool_]:
    """Rows in which a joint is slow for longer than ``LONGEST_REST``, shape (k, n)."""
    slow = _slow(motion)
    rests = np.zeros_like(slow)
    for j, column in enumerate(slow.T):
        for start, end in runs(column):
            rests[start:end, j] = (end - start) * motion.dt > LONGEST_REST
    return rests


def _slow(motion: MeasuredMotion) -> NDArray[np.bool_]:
    # A joint that never moves is at rest, too: rounding must not make it faster than its mean.
    return np.asarray(abs(motion.v) < REST_VELOCITY * np.sqrt((motion.v**2).mean(axis=0)) + 1e-12)


def pulses(still: NDArray[np.bool_], periods: float) -> Array:
    """Unit torques at times at which a joint may stick, one a column, shape (k, pulses).

    Args:
        still: Rows in which it may, shape (k,).
        periods: Periods of the band from row to row.
    """
    step = max(1, round(PULSE_PERIODS / periods))
    rows = [i for start, end in runs(still) for i in range(start, end, step)]
    columns = np.zeros((len(still), len(rows)))
    columns[rows, range(len(rows))] = 1.0
    return columns


@dataclass(frozen=True)
class Whitening:
    """Whitens a joint's rows by the covariance of its residual and of torques as it sticks.

    With directions D and powers P, it is the left factor (I + D P Dᵀ)^(-1/2).

    Attributes:
        directions: What such torques cause in the rows, orthonormal, shape (k, m).
        power: Of the torques along each, relative to the residual's, shape (m,).
    """

    directions: Array
    power: Array

    @classmethod
    def of(cls, torques: Array) -> Whitening:
        """Whitening of independent torques in the rows used, relative to the residual's size."""
        power, axes = np.linalg.eigh(torques.T @ torques)
        strong = power > LEAST_POWER
        return cls(torques @ (axes[:, strong] / np.sqrt(power[strong])), power[strong])

    def __call__(self, columns: Array) -> Array:
        """The columns of shape (k, …) whitened."""
        flat = columns.reshape(len(columns), -1)
        less = 1.0 - 1.0 / np.sqrt(1.0 + self.power)
        flat = flat - self.directions @ (less[:, None] * (self.directions.T @ flat))
        return np.asarray(flat.reshape(columns.shape))
