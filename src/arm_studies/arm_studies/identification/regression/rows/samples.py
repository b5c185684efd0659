# SPDX-License-Identifier: Apache-2.0
"""Measured motions as decimated rows, and which of these are used, held out, or at rest."""

from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_studies.identification.data import MeasuredMotion
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows import sticking
from arm_studies.identification.regression.rows.friction_columns import FrictionColumns
from arm_studies.identification.signals import decimation, filtering

HELD_OUT = 0.3  # Fraction of each recording, at its end, that is held out to measure errors.
FOLDS = 5  # Folds of the rest by which laws are selected, each predicted from the others.
# Independent values in which a joint cannot stick below which none of its are used: its unknowns
# would explain them exactly, so that they would weigh more than all others.
LEAST_VALUES = 25


class Samples:
    """Rows of all motions, one after the other, with as many as the band of each needs.

    Attributes:
        regressor: Of the nominal scene.
        whole: The motions at all measured times.
        motions: The motions at the rows.
        strides: Measured times from row to row, of each motion.
        stretches: Each stretch's motion and its rows.
        q: Positions, shape (k, n); like velocities and accelerations not filtered a second time.
        v: Velocities, shape (k, n).
        a: Accelerations, shape (k, n).
        unfiltered: Regressor of the bodies, shape (k, n, numbers).
        sliding: Columns of friction that are not filtered either.
        valid: Rows of each joint that were measured, shape (k, n).
        still: Rows in which a joint may stick, shape (k, n).
        rests: Rows in which it rests for longer than a reversal takes, shape (k, n).
        use: Rows that are used in the fit, shape (k, n): valid ones in which it does not, if there
            are ``LEAST_VALUES`` at least.
        fold: Fold of each row, shape (k,); -1 if it is held out.
        train: Rows that are not held out, shape (k,).
        n: Number of joints.
        names: Names of the joints.
        band: Cut-off frequency of the low-pass filter in [Hz].
        independent: Independent values of filtered noise per row.
        lag: Number of rows after which residuals are treated as independent.
    """

    def __init__(
        self, regressor: RigidRegressor, whole: Sequence[MeasuredMotion],
        held_out: float = HELD_OUT,
    ) -> None:  # fmt: skip
        """Thin motions, and hold out a fraction of each at its end."""
        self.regressor, self.names = regressor, tuple(regressor.model.joint_names)
        self.n, self.whole = len(self.names), tuple(whole)
        pairs = [decimation.thinned(motion) for motion in whole]
        self.motions, self.strides = [m for m, _ in pairs], [stride for _, stride in pairs]
        self.stretches, folds, start = list[tuple[MeasuredMotion, slice]](), [], 0
        for motion in self.motions:
            row, count = np.arange(len(motion.time)), round(len(motion.time) * (1.0 - held_out))
            fold = np.minimum(row * FOLDS // max(count, 1), FOLDS - 1)
            folds.append(np.where(row < count, fold, -1))
            for s in motion.stretches:
                self.stretches.append((motion, slice(start + s.start, start + s.stop)))
            start += len(motion.time)
        self.q, self.v, self.a, self.valid = (
            np.concatenate([getattr(motion, key) for motion in self.motions])
            for key in ("q", "v", "a", "valid")
        )
        self.unfiltered = regressor(self.q, self.v, self.a)
        self.sliding = FrictionColumns(whole, self.strides, [rows for _, rows in self.stretches])
        self.still = np.concatenate([sticking.may_stick(motion) for motion in self.motions])
        self.rests = np.concatenate([sticking.resting(motion) for motion in self.motions])
        self.independent = min(motion.independent for motion in self.motions)
        self.use = self.valid & ~self.still
        few = self.independent * self.use.sum(axis=0) < LEAST_VALUES
        self.use[:, few & ~few.all()] = False
        self.fold, self.band = np.concatenate(folds), self.motions[0].band
        self.train = self.fold >= 0
        self.lag = int(4.0 / (self.band * self.motions[0].dt)) if np.isfinite(self.band) else 1

    def smoothed(self, columns: Array, band: float | None = None) -> Array:
        """Low-pass filter columns as each motion is, or at a band of its own, shape (k, …)."""
        smooth = np.empty_like(columns, dtype=float)
        for motion, rows in self.stretches:
            low_pass = motion.low_pass if band is None else filtering.ZeroPhase(band, motion.dt)
            smooth[rows] = low_pass(columns[rows])
        return smooth
