# SPDX-License-Identifier: Apache-2.0
"""A recording at a constant rate, and its filtering into a motion with accelerations."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification.clock import with_corrected_stamps, without_repeats
from arm_studies.identification.data import JointRecord, MeasuredMotion, joined, row_words, runs
from arm_studies.identification.preparation import even_grid
from arm_studies.identification.preparation.doubtful_efforts import saturated, without_frozen
from arm_studies.identification.signals import cutoff, decimation, filtering

MOST_ROWS = 6_000  # Rows beyond which the band is narrowed, so that long recordings take seconds.
# Ratios of power from which high frequencies of positions and efforts are motion and no noise, see
# ``white_noise``. Without noise they are above 18 and 130; a controller that differentiates steps
# of encoders makes the second up to 14.
MOTION_RATIOS = 5.0, 40.0
WORDS = {"q": "position", "v": "velocity", "a": "acceleration", "effort": "effort"}


@dataclass(frozen=True)
class EvenRecord:
    """A recording at a constant rate, with corrected time stamps; not filtered.

    Attributes:
        stretches: Stretches without a gap; at least one.
        dt: Time between samples in [s].
        notes: Irregularities of the recording.
    """

    stretches: tuple[JointRecord, ...]
    dt: float
    notes: tuple[str, ...]

    @property
    def exact(self) -> bool:
        """Whether it has velocities and accelerations, so that nothing is filtered."""
        return all(np.isfinite(s.a).all() and np.isfinite(s.v).all() for s in self.stretches)

    @cached_property
    def band(self) -> float:
        """Cut-off frequency in [Hz] that suits the noise; see ``cutoff.chosen_band``."""
        if self.exact:
            return np.inf
        return max(cutoff.chosen_band(stretch.q, self.dt) for stretch in self.stretches)

    def filtered(self, band: float | None = None, age: float = 0.0) -> MeasuredMotion:
        """Low-pass filter with zero phase and differentiate; see ``prepare``.

        Args:
            band: Cut-off frequency in [Hz].
            age: Age of the efforts in [s] where the recording does not state it.

        Raises:
            InvalidInput: If the band is not positive, or too wide for the sampling rate.
        """
        band = self.band if band is None else band
        name, widest = self.stretches[0].name, cutoff.WIDEST / self.dt
        if not band > 0.0:
            raise InvalidInput(f"{name}: band is {band} Hz; a positive number is expected")
        if np.isfinite(band) and band > widest:
            raise InvalidInput(
                f"{name}: band is {band:g} Hz; at {1.0 / self.dt:.5g} samples per second; "
                f"allowed: up to {widest:.4g} Hz"
            )
        low_pass = filtering.ZeroPhase(np.inf if self.exact else band, self.dt)
        return joined([_motion(stretch, low_pass, age) for stretch in self.stretches], self.notes)


def prepare(record: JointRecord, band: float | None = None) -> MeasuredMotion:
    """Resample a recording at a constant rate, filter it with zero phase and differentiate it.

    Velocities and accelerations are derived from positions, since those that robots report are
    filtered with a lag. If most rows of a recording have accelerations, as from a computation, its
    positions, velocities and accelerations are used unchanged. Rows that lack one of these, and
    efforts that are missing or frozen, are left out; notes say where. If the recording states the
    age of its efforts, the motion is that at the times at which they acted.

    Args:
        record: Joint states.
        band: Cut-off frequency in [Hz]; None: chosen from the noise, see
            ``cutoff.chosen_band``; inf for no filter except in differentiation.

    Returns:
        The motion.

    Raises:
        InvalidInput: If positions are missing, or no stretch is long enough.
    """
    return resampled(record).filtered(band)


def resampled(record: JointRecord) -> EvenRecord:
    """Correct the time stamps of a recording and resample it at a constant rate.

    Raises:
        InvalidInput: If positions are missing, or no stretch is long enough.
    """
    # All of the motion in computed recordings, else positions.
    computed = (np.isfinite(record.v) & np.isfinite(record.a)).all(axis=1)
    needed = ("q", "v", "a") if computed.mean() > 0.5 else ("q",)
    whole = np.hstack([np.isfinite(getattr(record, key)) for key in needed]).all(axis=1)
    if not whole.any():
        missing = "no row has a position of every joint (--topic chooses another topic of a bag)"
        raise InvalidInput(f"{record.name}: {missing}")
    start, holes = record.time[0], _holes(record, (*needed, "effort"))
    record, stuck = without_frozen(without_repeats(record.rows(whole)), start)
    step = float(np.median(np.diff(record.time))) if len(record.time) > 1 else np.inf
    pieces, remarks = even_grid.pieces(record, step, start)
    notes = [*record.notes, *holes, *stuck, *remarks]
    pieces = [with_corrected_stamps(piece) for piece in pieces]
    notes += [note for piece in pieces for note in piece.notes if note not in notes]
    step = even_grid.mean_step(pieces, step)
    stretches = tuple(even_grid.at_even_times(piece, step) for piece in pieces)
    for stretch in stretches:
        shares = saturated(stretch.effort).mean(axis=0).tolist()
        notes += [
            f"'{name}': effort saturated in {share:.1%} of the samples"
            for name, share in zip(stretch.joint_names, shares, strict=True)
            if share > 0.0
        ]
    return EvenRecord(stretches, step, tuple(notes))


def _holes(record: JointRecord, keys: Sequence[str]) -> list[str]:
    """Notes of numbers that are missing of some of a joint's rows."""
    holes = []
    for key in keys:
        left_out = "its efforts there" if key == "effort" else "these rows"
        lost = ~np.isfinite(getattr(record, key))
        for name, rows in zip(record.joint_names, lost.T, strict=True):
            if rows.any() and not rows.all():
                where = row_words(rows, record.time - record.time[0])
                holes.append(f"'{name}': no {WORDS[key]} in {where}; {left_out} are not used")
    return holes


def common_band(recordings: Sequence[EvenRecord]) -> float:
    """The narrowest band that any of the recordings needs, or less for a long motion."""
    common = min(recording.band for recording in recordings)
    if not np.isfinite(common):
        return common
    spans = sum(len(part.time) * each.dt for each in recordings for part in each.stretches)
    return float(min(common, MOST_ROWS / (decimation.PER_BAND * spans)))


def _motion(grid: JointRecord, low_pass: filtering.ZeroPhase, age: float) -> MeasuredMotion:
    """Filter one even stretch, whose efforts are of this age if it does not state another."""
    efforts, valid = _valid_efforts(grid, low_pass.margin(len(grid.time)))
    filters = bool(np.isfinite(low_pass.band))
    if filters:
        before = age if grid.effort_age is None else grid.effort_age
        q, v, a = (low_pass(grid.q, derivative, before) for derivative in range(3))
    else:
        q, v, a = grid.q, grid.v, grid.a
    pairs = zip((grid.q, efforts), MOTION_RATIOS, strict=True)
    noise = [cutoff.white_noise(values, low_pass.dt, sloped) for values, sloped in pairs]
    return MeasuredMotion(
        joint_names=grid.joint_names, time=grid.time, q=read_only(q), v=read_only(v),
        a=read_only(a), effort=efforts, valid=valid, dt=low_pass.dt,
        stretches=(slice(0, len(grid.time)),), band=low_pass.band, low_pass=low_pass,
        name=grid.name, notes=grid.notes, aged=not filters or grid.effort_age is not None,
        noise=read_only(noise),
    )  # fmt: skip


def _valid_efforts(grid: JointRecord, margin: int) -> tuple[Array, NDArray[np.bool_]]:
    """Efforts of an even stretch, interpolated where they are missing, and which may be used.

    Those that are measured, with all within the margin of rows that filters need; (k, n) both.
    """
    measured = np.isfinite(grid.effort)
    usable = measured & ~saturated(grid.effort)
    rows, effort = np.arange(len(grid.time)), []
    near = usable.copy()  # usable, or in a hole so short that it is interpolated
    for j, present in enumerate(measured.T):
        values = grid.effort[present, j]
        effort.append(np.interp(rows, rows[present], values) if present.any() else 0.0 * rows)
        for start, end in runs(~usable[:, j]):
            near[start:end, j] = end - start < even_grid.GAP - 1.0
    # Valid together with all rows within the margin.
    bad = np.cumsum(np.vstack([np.zeros_like(near[:1]), ~near]), axis=0, dtype=np.int64)
    upper, lower = np.minimum(rows + margin + 1, len(rows)), np.maximum(rows - margin, 0)
    valid = usable & np.asarray(bad[upper] == bad[lower])
    valid[:margin] = valid[-margin:] = False
    return read_only(np.column_stack(effort)), valid
