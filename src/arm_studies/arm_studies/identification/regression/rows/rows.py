# SPDX-License-Identifier: Apache-2.0
"""Measured motions as rows of a regression: one per joint and time, with the same filter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.springs import SpringTerms
from arm_studies.identification.data import JointRecord, interpolated
from arm_studies.identification.preparation.even_record import EvenRecord, common_band, resampled
from arm_studies.identification.regression.friction import EXCESS, JointFit
from arm_studies.identification.regression.regressor import RigidRegressor
from arm_studies.identification.regression.rows.friction_columns import CACHE_SIZE
from arm_studies.identification.regression.rows.samples import Samples
from arm_studies.identification.regression.rows.sticking import Whitening, pulses
from arm_studies.identification.signals import decimation, filtering

POSITIONS = 50  # Positions at which inertias are computed to see what noise of accelerations does.


@dataclass(frozen=True)
class ArmRecordings:
    """Recordings of an arm at constant rates, and how they become rows of a regression.

    Attributes:
        regressor: Of the nominal scene.
        recordings: Not filtered.
        band: Cut-off frequency of the low-pass filter in [Hz].
        age: Age of the efforts in [s] where a recording does not state it.
        held_out: Fraction of each recording, at its end, that is held out.
        scales: Torque per unit of effort, shape (n,).
    """

    regressor: RigidRegressor
    recordings: tuple[EvenRecord, ...]
    band: float
    held_out: float
    age: float = 0.0
    scales: Array | float = 1.0

    @classmethod
    def of(
        cls, model: ArmModel, records: Sequence[JointRecord], band: float | None, held_out: float
    ) -> ArmRecordings:
        """Recordings from joint states; a band of None is chosen from the noise."""
        even = tuple(resampled(record) for record in records)
        band = common_band(even) if band is None else band
        return cls(RigidRegressor(model), even, band, held_out)

    @property
    def notes(self) -> list[str]:
        """Irregularities of the recordings."""
        return list(dict.fromkeys(note for each in self.recordings for note in each.notes))

    def rows(self, effort_band: float | None = None) -> Rows:
        """Filter them, at two bands if efforts are known to be filtered before."""
        motions = [each.filtered(self.band, self.age) for each in self.recordings]
        return Rows(Samples(self.regressor, motions, self.held_out), effort_band, self.scales)


@dataclass(frozen=True, eq=False)
class Rows:
    """The regression's rows: efforts of the samples, and columns that explain them.

    Columns are filtered as the efforts are, since an equation stays true if both sides are
    filtered; if the robot filters its efforts itself, columns are also filtered at
    ``effort_band``. Both sides are whitened against torques of joints that stick.

    Attributes:
        samples: The motions.
        effort_band: Cut-off frequency in [Hz] of the robot's own filter; None if it has none.
        scales: Torque per unit of effort, shape (n,).
        sticking: Of each joint, if rows are whitened, size of the unknown torque as it sticks, and
            standard deviation of its residual.
        _unwhitened: The rows before they were whitened, if they are.
    """

    samples: Samples
    effort_band: float | None = None
    scales: Array | float = 1.0
    sticking: tuple[tuple[float, float], ...] = ()
    _unwhitened: Rows | None = None

    @cached_property
    def effort(self) -> Array:
        """Low-pass filtered efforts, shape (k, n)."""
        efforts = [motion.filtered(motion.effort) for motion in self.samples.motions]
        return self.whiten(np.concatenate(efforts) * self.scales)

    @cached_property
    def rigid(self) -> Array:
        """Low-pass filtered regressor of the bodies, shape (k, n, numbers)."""
        columns = self.samples.unfiltered.copy()
        for j in range(self.samples.n):  # a joint does not carry the bodies before it
            carried = columns[:, j].any(axis=0)
            columns[:, j, carried] = self.filtered(columns[:, j, carried], j)
        return columns

    @cached_property
    def known_torques(self) -> Array:
        """Torques of payloads and springs, which are known, filtered, shape (k, n)."""
        samples, payload = self.samples, self.rigid @ self.samples.regressor.payload
        terms, torques = SpringTerms(samples.regressor.model), np.zeros_like(samples.q)
        if terms.springs:
            torques[:] = [terms.torque(*row) for row in zip(samples.q, samples.v, strict=True)]
        return np.asarray(payload + self.of_joints(torques))

    @cached_property
    def inertia(self) -> Array:
        """Low-pass filtered accelerations, shape (k, n), which an armature multiplies."""
        return self.of_joints(self.samples.a)

    def filtered(self, columns: Array, joint: int | None = None) -> Array:
        """Filter columns as the efforts, shape (k, …), and whiten them as those of a joint."""
        smooth = self.samples.smoothed(columns)
        if self.effort_band is not None and self.effort_band < self.samples.band:
            smooth = self.samples.smoothed(smooth, self.effort_band)
        return smooth if joint is None else self._whiten_at(smooth, joint)

    def of_joints(self, columns: Array) -> Array:
        """Filter columns as the efforts of each joint, shape (k, n, …)."""
        return self.whiten(self.filtered(columns))

    def whiten(self, columns: Array) -> Array:
        """Filtered columns of each joint as they are in these rows, shape (k, n, …)."""
        return np.stack([self._whiten_at(columns[:, j], j) for j in range(self.samples.n)], axis=1)

    def _whiten_at(self, columns: Array, joint: int) -> Array:
        return self._whitenings[joint](columns) if self._whitenings else columns

    def low_passed(self, effort_band: float | None) -> Rows:
        """The same rows, for efforts that were filtered before at ``effort_band``, or were not."""
        if effort_band == self.effort_band:
            return self
        rows = replace(self.unwhitened, effort_band=effort_band)
        return replace(rows, sticking=self.sticking, _unwhitened=rows) if self.sticking else rows

    def whitened(self, levels: Array, sizes: Array) -> Rows:
        """The same rows without what unknown torques of joints that stick can cause.

        The low-pass filter spreads such torques over rows in which the joint moves. These are
        whitened by the covariance of both: they count as little as such a torque is larger than
        the residual.

        Args:
            levels: Size of these torques, such as the joint's dry friction, shape (n,).
            sizes: Standard deviation of each joint's residual, shape (n,).
        """
        sticking = tuple(zip(levels.tolist(), sizes.tolist(), strict=True))
        return replace(self, sticking=sticking, _unwhitened=self.unwhitened)

    def with_larger_torques(self, factor: float) -> Rows:
        """The same rows whitened against torques that are larger by a factor."""
        sticking = tuple((factor * level, size) for level, size in self.sticking)
        return replace(self, sticking=sticking) if sticking else self

    @property
    def unwhitened(self) -> Rows:
        """The rows as they are measured, where joints stick, too."""
        return self._unwhitened or self

    @cached_property
    def _whitenings(self) -> list[Whitening]:
        """Of each joint, if the rows are whitened."""
        samples, whitenings = self.samples, []
        for j, (level, size) in enumerate(self.sticking if np.isfinite(samples.band) else ()):
            torques = pulses(samples.still[:, j], samples.band * samples.motions[0].dt)
            torques *= level / size * np.sqrt(samples.independent)
            whitenings.append(Whitening.of(self.filtered(torques) * samples.use[:, j : j + 1]))
        return whitenings

    @property
    def lost_freedoms(self) -> Array:
        """Number of independent values by which whitening leaves each joint fewer, shape (n,)."""
        lost = np.zeros(self.samples.n)
        for j, whitening in enumerate(self._whitenings):
            # Of noise within the band a direction has as much as the filter lets pass of it.
            passed = (self.samples.smoothed(whitening.directions) ** 2).sum(axis=0)
            lost[j] = passed @ (whitening.power / (1.0 + whitening.power))
        return lost

    def ageing(self, values: Array) -> Array:
        """Change of efforts, given by a fit, for each second by which they are older, (k, n).

        Zero in recordings that state the age of their efforts.
        """
        slopes = np.zeros_like(values)
        for motion, rows in self.samples.stretches:
            if not motion.aged:
                slopes[rows] = -np.gradient(values[rows], motion.dt, axis=0)
        return self.whiten(slopes)

    def noise(self, theta: Array, armature: Array) -> Array:
        """Standard deviation that white noise of the sensors has in each joint's rows, (n,).

        That of positions acts through accelerations.

        Args:
            theta: Inertial parameters of the bodies.
            armature: Inertia of each joint's drive, shape (n,).
        """
        regressor, q = self.samples.regressor, self.samples.q
        q = q[:: len(q) // POSITIONS + 1]
        still = np.zeros_like(q)
        columns = [
            (regressor(q, still, still + unit) - regressor(q, still, still)) @ theta
            for unit in np.eye(self.samples.n)
        ]
        squares = ((np.stack(columns, axis=2) + np.diag(armature)) ** 2).mean(axis=0)
        variances = []
        for motion in self.samples.whole:
            if not np.isfinite(motion.band):
                variances.append(motion.noise[1] ** 2)
                continue
            position, effort = 2.0 * motion.dt * motion.noise**2  # per [Hz]
            band = min(motion.band, self.effort_band or np.inf)
            accelerations = filtering.BENT_NOISE * band * (2.0 * np.pi * band) ** 4 * position
            variances.append(filtering.FLAT_NOISE * motion.band * effort + squares @ accelerations)
        return np.sqrt(np.mean(variances, axis=0))

    def friction(self, fit: JointFit, joint: int, load: Array) -> Array:
        """Low-pass filtered columns of a joint's friction, shape (k, kinds); see ``sliding``."""
        if fit.shape.load is not None:
            return self.filtered(self.samples.sliding(fit, joint, load), joint)
        columns, fall = np.empty((len(load), len(fit.kinds))), fit.shape.stribeck_velocity
        for i, kind in enumerate(fit.kinds):
            columns[:, i] = self._unloaded(joint, kind, fall if kind == EXCESS else None)
        return columns

    @cached_property
    def _unloaded(self) -> Callable[[int, str, float | None], Array]:
        """Filtered columns of friction that does not grow with the load, the last of them kept."""

        def column(joint: int, kind: str, stribeck_velocity: float | None) -> Array:
            weights = self.samples.sliding.weights(joint, kind, stribeck_velocity)
            return self.filtered(weights.sum(axis=1), joint)

        return lru_cache(CACHE_SIZE * self.samples.n)(column)


def nominal_efforts(rows: Rows) -> Array:
    """Efforts of the nominal scene in rows where joints stick, too, shape (k, n).

    Friction jumps with the velocity, and is computed at all measured times.
    """
    samples, regressor, model = rows.samples, rows.samples.regressor, rows.samples.regressor.model
    load = rows.rigid @ regressor.nominal + rows.known_torques + rows.inertia * model.armature
    friction, torques, start = SteadyFriction.of(model), [], 0
    for motion, thin, stride in zip(samples.whole, samples.motions, samples.strides, strict=True):
        own = load[start : start + len(thin.time)]
        start += len(thin.time)
        dense = interpolated(motion.time, thin.time, own)
        torque = friction(motion.v, np.sign(motion.v), np.zeros_like(motion.v), dense)
        torques += [decimation.decimated(torque[stretch], stride) for stretch in motion.stretches]
    return np.asarray(load + rows.of_joints(np.concatenate(torques)))
