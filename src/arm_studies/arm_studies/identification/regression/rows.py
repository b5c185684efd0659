# SPDX-License-Identifier: Apache-2.0
"""Measured motions as rows of a regression: one per joint and time, with the same filter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_studies.identification import filtering
from arm_studies.identification.data import JointRecord, MeasuredMotion, interpolated, runs
from arm_studies.identification.preparation import EvenRecord, common_band, resampled, thinned
from arm_studies.identification.regression.friction import DRY, EXCESS, JointFit, Shape
from arm_studies.identification.regression.regressor import RigidRegressor

HELD_OUT = 0.3  # Fraction of each recording, at its end, that is held out to measure errors.
FOLDS = 5  # Folds of the rest by which laws are selected, each predicted from the others.
# Time in [s] for which a joint whose velocity is exact may be at rest, and most of the time before
# and after a reversal in which one may stick.
LONGEST_REST = 0.1
# Periods of the band before and after a joint rests or reverses in which it may stick: its
# friction has then any value up to static friction. Periods from one to the next of its values
# that are unknown there.
STICKING_PERIODS, PULSE_PERIODS = 0.3, 0.2
# Independent values in which a joint cannot stick below which none of its are used: its unknowns
# would explain them exactly, so that they would weigh more than all others.
LEAST_VALUES = 25
SAMPLED = 50  # Positions at which inertias are computed to see what noise of accelerations does.
# Power of such a value, relative to the residual's, below which it does not matter.
LEAST_POWER = 1e-3
# Velocity relative to a joint's root mean square velocity below which it is at rest; the low-pass
# filter rings by up to 5e-3 of it when a joint sticks.
REST_VELOCITY = 1e-2


@dataclass(frozen=True)
class Sampled:
    """Recordings of an arm at constant rates, and how they become rows of a regression.

    Attributes:
        regressor: Of the nominal scene.
        recordings: Not filtered.
        band: Cut-off frequency of the low-pass filter in [Hz].
        age: That of the efforts in [s] where a recording does not state it.
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
    ) -> Sampled:
        """Of joint states; with None as band, it is chosen from the noise."""
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
        return Rows(self.regressor, motions, effort_band, self.held_out, self.scales)


class Rows:
    """The regression's rows of all motions.

    Columns are decimated and filtered as the efforts are, since an equation stays true if both
    sides are filtered; if the robot filters its efforts itself, columns are also filtered at
    ``effort_band``.

    Attributes:
        effort: Low-pass filtered efforts, shape (k, n).
        rigid: Low-pass filtered regressor of the bodies, shape (k, n, numbers).
        inertia: Low-pass filtered accelerations, shape (k, n), which an armature multiplies.
        v: Velocities, not filtered a second time, shape (k, n).
        valid: Rows of each joint that were measured, shape (k, n).
        still: Rows in which a joint may stick, shape (k, n).
        rests: Rows in which it rests for longer than a reversal takes, shape (k, n).
        use: Rows that are used in the fit, shape (k, n): valid ones in which it does not, if there
            are ``LEAST_VALUES`` at least.
        train: Rows that are not held out, shape (k,).
        fold: Fold of each row, shape (k,); -1 if it is held out.
        independent: Independent values of filtered noise per row.
        lag: Number of rows after which residuals are treated as independent.
    """

    def __init__(
        self, regressor: RigidRegressor, motions: Sequence[MeasuredMotion],
        effort_band: float | None = None, held_out: float = HELD_OUT,
        scales: Array | float = 1.0,
    ) -> None:  # fmt: skip
        self.regressor, self.whole, self.effort_band = regressor, tuple(motions), effort_band
        self._friction_columns: dict[tuple[int, str], tuple[float | None, Array, Array]] = {}
        pairs = [thinned(motion) for motion in motions]
        self.motions, self.strides = [m for m, _ in pairs], [stride for _, stride in pairs]
        self.q, self.v, self.a = (
            np.concatenate([getattr(motion, key) for motion in self.motions]) for key in "qva"
        )
        near, reach = list[NDArray[np.int_]](), np.arange(-filtering.REACH, filtering.REACH + 1)
        for _, s in self._stretches():  # of each row, in its stretch
            rows = np.arange(s.start, s.stop)[:, None] + reach
            near.append(np.clip(rows, s.start, s.stop - 1))
        self._near = np.concatenate(near)
        self._sticking: tuple[Array, Array] | None = None
        self._plain: Rows | None = None
        efforts = [motion.filtered(motion.effort) for motion in self.motions]
        self.effort = np.concatenate(efforts) * scales
        self.valid = np.concatenate([motion.valid for motion in self.motions])
        self.still = np.concatenate([_still(motion) for motion in self.motions])
        self.use = self.valid & ~self.still
        self.independent = min(motion.independent for motion in self.motions)
        few = self.independent * self.use.sum(axis=0) < LEAST_VALUES
        self.use[:, few & ~few.all()] = False
        self.rests = np.concatenate([_resting(motion) for motion in self.motions])
        self.fold = np.concatenate([_folds(motion, held_out) for motion in self.motions])
        self.train = self.fold >= 0
        self.lag = int(4.0 / (self.band * self.motions[0].dt)) if np.isfinite(self.band) else 1

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.v.shape[1])

    def scaled(self, scales: Array) -> Rows:
        """The same rows with efforts multiplied by a factor of each joint."""
        other = copy(self)
        other.effort = self.effort * scales
        return other

    @property
    def names(self) -> tuple[str, ...]:
        """Of the joints."""
        return tuple(self.regressor.model.joint_names)

    @cached_property
    def rigid(self) -> Array:  # noqa: D102 - see the attributes
        columns = self._unfiltered.copy()
        for j in range(self.n):  # a joint does not carry the bodies before it
            carried = columns[:, j].any(axis=0)
            columns[:, j, carried] = self.filtered(columns[:, j, carried], j)
        return columns

    @cached_property
    def _unfiltered(self) -> Array:
        return self.regressor(self.q, self.v, self.a)

    @cached_property
    def known_torques(self) -> Array:
        """Torques of payloads and springs, which are known, filtered, shape (k, n)."""
        payload = self.rigid @ self.regressor.payload
        return np.asarray(payload + self.of_joints(self.regressor.spring(self.q, self.v)))

    @cached_property
    def inertia(self) -> Array:  # noqa: D102 - see the attributes
        return self.of_joints(self.a)

    def filtered(self, columns: Array, joint: int | None = None) -> Array:
        """Filter columns as the efforts, shape (k, …), and clear them as those of a joint."""
        ends = np.cumsum([len(motion.time) for motion in self.motions])[:-1]
        parts = zip(np.split(columns, ends), self.motions, strict=True)
        smooth = np.concatenate([motion.filtered(part) for part, motion in parts])
        if self.effort_band is not None and self.effort_band < self.band:
            smooth = self.narrowed(smooth, self.effort_band)
        return smooth if joint is None else self._cleared(smooth, joint)

    def of_joints(self, columns: Array) -> Array:
        """Filter columns as the efforts of each joint, shape (k, n, …)."""
        return self.clear(self.filtered(columns))

    def clear(self, columns: Array) -> Array:
        """Filtered columns of each joint as they are in these rows, shape (k, n, …)."""
        return np.stack([self._cleared(columns[:, j], j) for j in range(self.n)], axis=1)

    def cleared(self, levels: Array, sizes: Array) -> Rows:
        """The same rows without what unknown torques of joints that stick can cause.

        The low-pass filter spreads such torques over rows in which the joint moves. These are
        whitened by the covariance of both: they count as little as such a torque is larger than
        the residual.

        Args:
            levels: Size of these torques, such as the joint's dry friction, shape (n,).
            sizes: Standard deviation of each joint's residual, shape (n,).
        """
        other = self._again()
        other._sticking, other._plain = (np.asarray(levels), sizes), self.plain
        other.effort = other.clear(other._plain.effort)
        return other

    def stricter(self, factor: float) -> Rows:
        """The same rows cleared of torques that are larger by a factor."""
        if self._sticking is None:
            return self
        levels, sizes = self._sticking
        return self.cleared(factor * levels, sizes)

    @property
    def plain(self) -> Rows:
        """The rows as they are measured, where joints stick, too."""
        return self._plain or self

    @cached_property
    def _clearings(self) -> list[tuple[Array, Array, float]]:
        """Of each joint: directions in its rows, by how much these count less, ``spent``."""
        if self._sticking is None or not np.isfinite(self.band):
            return [(np.zeros((len(self.v), 0)), np.zeros(0), 0.0)] * self.n
        return [
            self._clearing(j, *pair) for j, pair in enumerate(zip(*self._sticking, strict=True))
        ]

    def _clearing(self, joint: int, level: float, size: float) -> tuple[Array, Array, float]:
        step = max(1, round(PULSE_PERIODS / (self.band * self.motions[0].dt)))
        at = [i for start, end in runs(self.still[:, joint]) for i in range(start, end, step)]
        pulses = np.zeros((len(self.v), len(at)))
        pulses[at, range(len(at))] = level / size * np.sqrt(self.independent)
        spread_out = self.filtered(pulses) * self.use[:, joint : joint + 1]
        power, axes = np.linalg.eigh(spread_out.T @ spread_out)
        strong = power > LEAST_POWER
        directions = spread_out @ (axes[:, strong] / np.sqrt(power[strong]))
        # Of noise within the band a direction has as much as the filter lets pass of it.
        passed = (self.plain.low_passed(None).filtered(directions) ** 2).sum(axis=0)
        spent = float(passed @ (power[strong] / (1.0 + power[strong])))
        return directions, 1.0 - 1.0 / np.sqrt(1.0 + power[strong]), spent

    def _cleared(self, columns: Array, joint: int) -> Array:
        directions, less, _ = self._clearings[joint]
        if not less.size:
            return columns
        flat = columns.reshape(len(columns), -1)
        flat = flat - directions @ (less[:, None] * (directions.T @ flat))
        return np.asarray(flat.reshape(columns.shape))

    def ageing(self, values: Array) -> Array:
        """Change of efforts, given by a fit, for each second by which they are older, (k, n).

        Zero in recordings that state the age of their efforts.
        """
        slopes = np.zeros_like(values)
        for motion, span in self._stretches():
            if not motion.aged:
                slopes[span] = -np.gradient(values[span], motion.dt, axis=0)
        return self.clear(slopes)

    def noise(self, theta: Array, armature: Array) -> Array:
        """Standard deviation that white noise of the sensors has in each joint's rows, (n,).

        That of positions acts through accelerations.

        Args:
            theta: Inertial parameters of the bodies.
            armature: Inertia of each joint's drive, shape (n,).
        """
        q = self.q[:: len(self.q) // SAMPLED + 1]
        still = np.zeros_like(q)
        columns = [
            (self.regressor(q, still, still + unit) - self.regressor(q, still, still)) @ theta
            for unit in np.eye(self.n)
        ]
        squares = ((np.stack(columns, axis=2) + np.diag(armature)) ** 2).mean(axis=0)
        variances = []
        for motion in self.whole:
            if not np.isfinite(motion.band):
                variances.append(motion.noise[1] ** 2)
                continue
            position, effort = 2.0 * motion.dt * motion.noise**2  # per [Hz]
            band = min(motion.band, self.effort_band or np.inf)
            accelerations = filtering.BENT_NOISE * band * (2.0 * np.pi * band) ** 4 * position
            variances.append(filtering.FLAT_NOISE * motion.band * effort + squares @ accelerations)
        return np.sqrt(np.mean(variances, axis=0))

    @property
    def spent(self) -> Array:
        """Number of independent values by which each joint has fewer, shape (n,)."""
        return np.array([spent for *_, spent in self._clearings])

    def _again(self) -> Rows:
        """A copy without what has been computed."""
        other = copy(self)
        other._friction_columns = {}
        for name in ("rigid", "known_torques", "inertia", "_clearings"):
            vars(other).pop(name, None)
        return other

    @property
    def band(self) -> float:
        """Cut-off frequency of the low-pass filter in [Hz]."""
        return self.motions[0].band

    def low_passed(self, effort_band: float | None) -> Rows:
        """The same rows, for efforts that were filtered before at ``effort_band``, or were not."""
        if effort_band == self.effort_band:
            return self
        other = self.plain._again()
        other.effort_band = effort_band
        return other if self._sticking is None else other.cleared(*self._sticking)

    def ahead(self, joint: int, by: int) -> tuple[Array, NDArray[np.bool_]]:
        """A joint's efforts some rows later, in the same stretch, and which are valid, (k,)."""
        effort, valid = np.zeros(len(self.effort)), np.zeros(len(self.valid), bool)
        for _, s in self._stretches():
            to = slice(max(s.start, s.start - by), min(s.stop, s.stop - by))
            if to.stop > to.start:
                of = slice(to.start + by, to.stop + by)
                effort[to], valid[to] = self.effort[of, joint], self.valid[of, joint]
        return effort, valid

    def _stretches(self) -> Iterator[tuple[MeasuredMotion, slice]]:
        """Each stretch of each motion, and its rows."""
        start = 0
        for motion in self.motions:
            for stretch in motion.stretches:
                yield motion, slice(start + stretch.start, start + stretch.stop)
            start += len(motion.time)

    def narrowed(self, columns: Array, band: float) -> Array:
        """Low-pass filter columns once more, at a band of its own, shape (k, …)."""
        smooth = np.empty_like(columns)
        for motion, span in self._stretches():
            smooth[span] = filtering.ZeroPhase(band, motion.dt)(columns[span])
        return smooth

    def friction(self, fit: JointFit, joint: int, load: Array) -> Array:
        """Low-pass filtered columns of a joint's friction, shape (k, kinds); see ``sliding``."""
        if fit.shape.load is not None:
            return self.filtered(self.sliding(fit, joint, load), joint)
        columns = np.empty((len(load), len(fit.kinds)))
        for i, kind in enumerate(fit.kinds):
            columns[:, i] = self._unloaded(joint, kind, fit.shape.stribeck_velocity)[1]
        return columns

    def sliding(self, fit: JointFit, joint: int, load: Array) -> Array:
        """Columns of a joint's friction, decimated but not yet filtered, shape (k, kinds).

        Friction jumps with the velocity: what depends on it is computed at all measured times,
        and once. The growth with the load, which depends on the fit, is computed at the rows.

        Args:
            fit: Kinds and shape.
            joint: Index of the joint.
            load: Torque of its drive in each row, shape (k,).
        """
        columns, growth = np.empty((len(load), len(fit.kinds))), fit.shape.growth(load)[self._near]
        for i, kind in enumerate(fit.kinds):
            weights, _ = self._unloaded(joint, kind, fit.shape.stribeck_velocity)
            grows = kind in DRY
            columns[:, i] = (
                np.einsum("kd,kd->k", weights, growth) if grows else weights.sum(axis=1)
            )
        return columns

    def _unloaded(self, joint: int, kind: str, fall: float | None) -> tuple[Array, Array]:
        """Weights of a column for factors in the rows nearby, and the filtered column alone."""
        fall = fall if kind == EXCESS else None
        entry = self._friction_columns.get((joint, kind))
        if entry is None or entry[0] != fall:
            weights = np.concatenate([
                filtering.spread(Shape(fall).unloaded(kind, motion.v[stretch, joint]), stride)
                for motion, stride in zip(self.whole, self.strides, strict=True)
                for stretch in motion.stretches
            ])  # fmt: skip
            entry = fall, weights, self.filtered(weights.sum(axis=1), joint)
            self._friction_columns[joint, kind] = entry
        return entry[1:]


def _folds(motion: MeasuredMotion, held_out: float) -> NDArray[np.int_]:
    """Fold of each row, shape (k,); -1 if it is held out."""
    row, count = np.arange(len(motion.time)), round(len(motion.time) * (1.0 - held_out))
    return np.where(row < count, np.minimum(row * FOLDS // max(count, 1), FOLDS - 1), -1)


def _slow(motion: MeasuredMotion) -> NDArray[np.bool_]:
    """Where a joint is slow, shape (k, n)."""
    return np.asarray(abs(motion.v) < REST_VELOCITY * np.sqrt((motion.v**2).mean(axis=0)) + 1e-12)


def _still(motion: MeasuredMotion) -> NDArray[np.bool_]:
    """Rows in which a joint may stick, shape (k, n).

    Where the velocity is filtered, as it rests or reverses, and nearby; else as it rests.
    """
    if not np.isfinite(motion.band):
        return _resting(motion)
    slow = _slow(motion)
    reach = round(min(STICKING_PERIODS / motion.band, LONGEST_REST) / motion.dt)
    still = np.zeros_like(slow)
    for s in motion.stretches:
        turns = motion.v[s][1:] * motion.v[s][:-1] < 0.0
        slow[s][1:] |= turns
        slow[s][:-1] |= turns
        for j, column in enumerate(slow[s].T):
            for start, end in runs(column):
                still[s][max(0, start - reach) : end + reach, j] = True
    return still


def _resting(motion: MeasuredMotion) -> NDArray[np.bool_]:
    """Rows in which a joint is slow for longer than ``LONGEST_REST``, shape (k, n)."""
    slow = _slow(motion)
    resting = np.zeros_like(slow)
    for j, column in enumerate(slow.T):
        for start, end in runs(column):
            resting[start:end, j] = (end - start) * motion.dt > LONGEST_REST
    return resting


def nominal_efforts(rows: Rows) -> Array:
    """Efforts of the nominal scene in rows where joints stick, too, shape (k, n).

    Friction jumps with the velocity, and is computed at all measured times.
    """
    regressor, model = rows.regressor, rows.regressor.model
    load = rows.rigid @ regressor.nominal + rows.known_torques + rows.inertia * model.armature
    friction, torques, start = SteadyFriction.of(model), [], 0
    for motion, thin, stride in zip(rows.whole, rows.motions, rows.strides, strict=True):
        own = load[start : start + len(thin.time)]
        start += len(thin.time)
        dense = interpolated(motion.time, thin.time, own)
        torque = friction(motion.v, np.sign(motion.v), np.zeros_like(motion.v), dense)
        torques += [filtering.decimated(torque[stretch], stride) for stretch in motion.stretches]
    return np.asarray(load + rows.of_joints(np.concatenate(torques)))
