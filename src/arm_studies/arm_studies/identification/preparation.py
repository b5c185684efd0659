# SPDX-License-Identifier: Apache-2.0
"""Resampling and filtering of joint states into a motion with accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification.clock import repaired, without_repeats
from arm_studies.identification.data import JointRecord, MeasuredMotion, interpolated, runs
from arm_studies.identification.signals import cutoff, decimation, filtering

# Steps without a sample that split a recording; over shorter holes the filter gets interpolated
# values, and only the samples that are missing are left out.
GAP = 4.5
EFFORT_REACH = 0.5  # Steps from a sample up to which an effort is known.
SHORTEST = 100  # Smallest number of samples of a stretch.
PER_BAND = 10.0  # Rows per period of the band that ``thinned`` keeps.
MOST_ROWS = 6_000  # Rows beyond which the band is narrowed, so that long recordings take seconds.
# Fraction of a step by which samples may be off an even grid without being interpolated.
GRID_TOLERANCE = 1e-3
SATURATED = 8  # Number of consecutive samples at the same extreme effort that indicate saturation.
# Departure of a position from uniform motion in [rad] or [m] from which an effort that does not
# change is frozen: in uniform motion it may be constant.
DEPARTURE = 1e-3
# Change after which an effort was frozen, over its typical change, if that is less than ``COARSE``
# times its small ones: those of a coarse sensor are all alike, and its long runs end with one of
# them.
JUMP, COARSE = 3.0, 3.0
# Ratios of power from which high frequencies of positions and efforts are motion and no noise, see
# ``white_noise``. Without noise they are above 18 and 130; a controller that differentiates steps
# of encoders makes the second up to 14.
MOTION_RATIOS = 5.0, 40.0
LISTED_SPANS = 3  # Stretches that a note lists.
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
            age: That of the efforts in [s] where the recording does not state it.

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
    holes, start = list[str](), record.time[0]
    for key in (*needed, "effort"):
        left_out = "its efforts there" if key == "effort" else "these rows"
        for name, lost in zip(
            record.joint_names, ~np.isfinite(getattr(record, key)).T, strict=True
        ):
            if lost.any() and not lost.all():
                where = _places(lost, record.time - start)
                holes.append(f"'{name}': no {WORDS[key]} in {where}; {left_out} are not used")
    record, stuck = _without_frozen(without_repeats(record.rows(whole)), start)
    step = float(np.median(np.diff(record.time))) if len(record.time) > 1 else np.inf
    pieces, remarks = _pieces(record, step, start)
    notes = [*record.notes, *holes, *stuck, *remarks]
    pieces = [repaired(piece) for piece in pieces]
    notes += [note for piece in pieces for note in piece.notes if note not in notes]
    longest = max(pieces, key=lambda piece: len(piece.time))
    steps = float(np.rint(np.diff(longest.time) / step).sum())  # also over rows that are missing
    mean = float(longest.time[-1] - longest.time[0]) / max(steps, 1.0)
    # The mean where times are even, so that no drift adds up; else the median.
    step = mean if abs(mean - step) < 0.02 * step else step
    stretches = tuple(_even(piece, step) for piece in pieces)
    for stretch in stretches:
        shares = saturated(stretch.effort).mean(axis=0).tolist()
        notes += [
            f"'{name}': effort saturated in {share:.1%} of the samples"
            for name, share in zip(stretch.joint_names, shares, strict=True)
            if share > 0.0
        ]
    return EvenRecord(stretches, step, tuple(notes))


def common_band(recordings: Sequence[EvenRecord]) -> float:
    """The narrowest band that any of the recordings needs, or less for a long motion."""
    common = min(recording.band for recording in recordings)
    if not np.isfinite(common):
        return common
    spans = sum(len(part.time) * each.dt for each in recordings for part in each.stretches)
    return float(min(common, MOST_ROWS / (PER_BAND * spans)))


def _places(mask: NDArray[np.bool_], time: Array) -> str:
    """How often and when a condition holds, in words."""
    count = np.count_nonzero(mask)
    rows = "1 row" if count == 1 else f"{count} rows"
    return f"{rows} ({_listed(time[runs(mask) - [0, 1]])})"


def _listed(spans: Array) -> str:
    """Spans of time in [s] from the start, shape (m, 2), in words."""
    texts = [f"{a:.3f} s" if a == b else f"{a:.3f} to {b:.3f} s" for a, b in spans[:LISTED_SPANS]]
    more = f" and {len(spans) - LISTED_SPANS} times more," if len(spans) > LISTED_SPANS else ""
    return f"{', '.join(texts)}{more} after the start"


def _without_frozen(record: JointRecord, start: float) -> tuple[JointRecord, list[str]]:
    """The record without efforts that did not change while the joint's speed did, and notes."""
    effort, notes = np.array(record.effort), []
    for j, name in enumerate(record.joint_names):
        stale = _frozen(record.q[:, j], effort[:, j])
        if stale.any():
            effort[stale, j] = np.nan
            notes.append(
                f"'{name}': effort frozen in {_places(stale, record.time - start)} while the "
                "joint moves; its efforts there are not used (a sensor or a driver that stopped?)"
            )
    return replace(record, effort=read_only(effort)), notes


def _frozen(q: Array, effort: Array) -> NDArray[np.bool_]:
    """Samples that repeat the one before in long runs that the motion does not explain, (k,)."""
    frozen, change = np.zeros(len(q), bool), abs(np.diff(effort, append=np.nan))
    changed = np.flatnonzero(change > 0.0)
    if changed.size < 2:
        return frozen  # a constant effort is refused in ``checks``
    interval = float(np.median(np.diff(changed)))  # more than one if it is measured more slowly
    small, typical = np.quantile(change[changed], [0.05, 0.5])
    least = JUMP * typical if typical < COARSE * small else 0.0
    for start, last in runs(change == 0.0):
        length = last - start + 1
        bent = abs(q[start : last + 1] - np.linspace(q[start], q[last], length)).max() > DEPARTURE
        # At the end of the recording, or before a hole, no change is known.
        if length >= SATURATED * interval and bent and not change[last] <= least:
            frozen[start + 1 : last + 1] = True
    return frozen


def thinned(motion: MeasuredMotion) -> tuple[MeasuredMotion, int]:
    """The motion with only as many rows as its band needs, ``PER_BAND`` per period.

    Returns:
        The motion, and the stride of the rows that it keeps.
    """
    stride = max(1, int(1.0 / (PER_BAND * motion.band * motion.dt) + 1e-9))
    if stride == 1:
        return motion, 1
    dt = stride * motion.dt
    low_pass = filtering.ZeroPhase(motion.band, dt)
    parts = []
    for stretch in motion.stretches:
        part, rows = motion.span(stretch), slice(0, None, stride)
        values: dict[str, Any] = {
            key: getattr(part, key)[rows] for key in ("time", "q", "v", "a", "valid")
        }
        values["effort"] = decimation.decimated(part.effort, stride)
        stretches = (slice(0, len(values["time"])),)
        values |= {"dt": dt, "low_pass": low_pass, "stretches": stretches}
        parts.append(replace(part, **values))
    return joined(parts, motion.notes), stride


def joined(motions: Sequence[MeasuredMotion], notes: Sequence[str] = ()) -> MeasuredMotion:
    """Concatenate motions of the same rate and filter, each as stretches of its own."""
    first = motions[0]
    starts = np.cumsum([0, *(len(motion.time) for motion in motions)])
    stretches = tuple(
        slice(s.start + int(start), s.stop + int(start))
        for motion, start in zip(motions, starts, strict=False)
        for s in motion.stretches
    )
    parts: dict[str, Any] = {
        key: read_only(np.concatenate([getattr(motion, key) for motion in motions]))
        for key in ("time", "q", "v", "a", "effort")
    }
    valid = np.concatenate([motion.valid for motion in motions])
    return replace(first, **parts, valid=valid, stretches=stretches, notes=tuple(notes))


def _pieces(record: JointRecord, step: float, start: float) -> tuple[list[JointRecord], list[str]]:
    """Stretches without a gap that are long enough, and notes of the gaps.

    Raises:
        InvalidInput: If there is none.
    """
    cuts, notes = np.flatnonzero(np.diff(record.time) > GAP * step) + 1, []
    if cuts.size:
        gaps = np.column_stack([record.time[cuts - 1], record.time[cuts]]) - start
        notes.append(f"the motion has gaps ({_listed(gaps)}); nothing is used near them")
    edges = [0, *cuts.tolist(), len(record.time)]
    spans = [slice(a, b) for a, b in zip(edges, edges[1:], strict=False)]
    long = [s for s in spans if s.stop - s.start >= SHORTEST]
    if short := len(record.time) - sum(s.stop - s.start for s in long):
        notes.append(f"{short} rows in stretches of fewer than {SHORTEST} samples are not used")
    if not long:
        raise InvalidInput(
            f"{record.name}: no stretch of {SHORTEST} samples without a gap of more than "
            f"{GAP * step:.3g} s; it has {len(record.time)} samples, {step:.3g} s apart"
        )
    return [record.rows(s) for s in long], notes


def _even(piece: JointRecord, step: float) -> JointRecord:
    """A stretch at even times."""
    count = round(float(piece.time[-1] - piece.time[0]) / step)
    time = piece.time[0] + step * np.arange(count + 1)
    if len(time) == len(piece.time) and abs(time - piece.time).max() < GRID_TOLERANCE * step:
        return replace(piece, time=read_only(time))
    time = time[time <= piece.time[-1]]
    after = np.clip(np.searchsorted(piece.time, time), 1, len(piece.time) - 1)
    far = np.minimum(time - piece.time[after - 1], piece.time[after] - time) > EFFORT_REACH * step
    slopes = np.gradient(piece.q, piece.time, axis=0)
    effort, v, a = (interpolated(time, piece.time, x) for x in (piece.effort, piece.v, piece.a))
    effort[far] = np.nan
    new = {"time": time, "q": cubic(time, piece.time, piece.q, slopes)}
    new |= {"effort": effort, "v": v, "a": a}
    parts: dict[str, Any] = {key: read_only(values) for key, values in new.items()}
    return replace(piece, **parts)


def cubic(at: Array, time: Array, x: Array, slopes: Array) -> Array:
    """Hermite's cubics through samples with given slopes, shape (m, n)."""
    i = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    h = (time[i + 1] - time[i])[:, None]
    s = (at - time[i])[:, None] / h
    rise = x[i + 1] - x[i]
    first, last = h * slopes[i], h * slopes[i + 1]
    return np.asarray(
        x[i]
        + s * (first + s * (3.0 * rise - 2.0 * first - last + s * (first + last - 2.0 * rise)))
    )


def _motion(grid: JointRecord, low_pass: filtering.ZeroPhase, age: float) -> MeasuredMotion:
    """Filter one even stretch, whose efforts are of this age if it does not state another."""
    measured = np.isfinite(grid.effort)
    usable = measured & ~saturated(grid.effort)
    margin, rows, effort = low_pass.margin(len(grid.time)), np.arange(len(grid.time)), []
    near = usable.copy()  # usable, or in a hole so short that it is interpolated
    for j, present in enumerate(measured.T):
        values = grid.effort[present, j]
        effort.append(np.interp(rows, rows[present], values) if present.any() else 0.0 * rows)
        for start, end in runs(~usable[:, j]):
            near[start:end, j] = end - start < GAP - 1.0
    # Valid together with all rows within the margin.
    bad = np.cumsum(np.vstack([np.zeros_like(near[:1]), ~near]), axis=0, dtype=np.int64)
    upper, lower = np.minimum(rows + margin + 1, len(rows)), np.maximum(rows - margin, 0)
    valid = usable & np.asarray(bad[upper] == bad[lower])
    valid[:margin] = valid[-margin:] = False
    filters = bool(np.isfinite(low_pass.band))
    if filters:
        before = age if grid.effort_age is None else grid.effort_age
        q, v, a = (low_pass(grid.q, derivative, before) for derivative in range(3))
    else:
        q, v, a = grid.q, grid.v, grid.a
    efforts = read_only(np.column_stack(effort))
    pairs = zip((grid.q, efforts), MOTION_RATIOS, strict=True)
    noise = [cutoff.white_noise(values, low_pass.dt, sloped) for values, sloped in pairs]
    return MeasuredMotion(
        joint_names=grid.joint_names, time=grid.time, q=read_only(q), v=read_only(v),
        a=read_only(a), effort=efforts, valid=valid, dt=low_pass.dt,
        stretches=(slice(0, len(grid.time)),), band=low_pass.band, low_pass=low_pass,
        name=grid.name, notes=grid.notes, aged=not filters or grid.effort_age is not None,
        noise=read_only(noise),
    )  # fmt: skip


def saturated(effort: Array) -> NDArray[np.bool_]:
    """Samples in long runs of one and the same extreme value, shape (k, n)."""
    clipped = np.zeros(effort.shape, bool)
    for i, column in enumerate(effort.T):
        for extreme in (np.nanmin(column, initial=np.inf), np.nanmax(column, initial=-np.inf)):
            for start, end in runs(column == extreme):
                clipped[start:end, i] |= end - start >= SATURATED
        if np.nanmin(column, initial=np.inf) >= np.nanmax(column, initial=-np.inf):
            clipped[:, i] = False  # a constant effort is refused in ``checks``
    return clipped
