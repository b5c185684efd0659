# SPDX-License-Identifier: Apache-2.0
"""Correction of time stamps, from the errors that all joints have in common; repeated rows."""

from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_studies.identification.data import JointRecord, interpolated, runs
from arm_studies.identification.signals.cutoff import NOISE_RATIO, WIDEST, chosen_band
from arm_studies.identification.signals.filtering import ZeroPhase

ROUNDS = 4  # Of correcting stamps by the motion, which is filtered anew with them.
# Fraction of the positions' noise power that late stamps must explain to be corrected.
EXPLAINED_FRACTION = 0.75
LEAST_ERROR = 1e-2  # Errors below this fraction of the sampling interval are not corrected.
LONGEST_REPETITION = 3  # Largest number of repetitions of a row; in longer ones the robot rests.
MOTION_RATIO = 30.0  # Ratio to the noise above which the power of a position is motion.


def without_repeats(record: JointRecord) -> JointRecord:
    """The recording without rows that repeat the one before.

    Drivers publish the last state that they have, again if no other has arrived.

    Args:
        record: Joint states.

    Returns:
        The recording, with a note if it had such rows. Computed recordings, which have
        accelerations, are not changed.
    """
    if np.isfinite(record.a).all():
        return record
    both = np.hstack([record.q, record.effort])
    same = (both[1:] == both[:-1]) | np.isnan(both[1:]) & np.isnan(both[:-1])
    repeated = np.concatenate([[False], same.all(axis=1)])
    for start, end in runs(repeated):
        repeated[start:end] = end - start <= LONGEST_REPETITION
    if not repeated.any():
        return record
    note = f"{np.count_nonzero(repeated)} rows repeat the one before and are not used"
    return replace(record.rows(~repeated), notes=(*record.notes, note))


def with_corrected_stamps(record: JointRecord) -> JointRecord:
    """The recording with corrected time stamps, if they cause most of its noise.

    A stamp that is late by δ shifts the position of *every* joint by q̇ δ. So n positions at one
    time determine δ and leave n - 1 numbers to check it: δ is the weighted mean of the joints'
    deviations over their velocities, and is applied only if it removes ``EXPLAINED_FRACTION`` of
    their power. Efforts are assumed to be sampled at the same instants. Likewise, even times
    replace the stamps if the positions have that much less noise at them: then samples were even,
    and stamps are those of the transport.

    Args:
        record: Joint states without gaps.

    Returns:
        The recording, with a note if its stamps were changed.
    """
    if record.q.shape[1] < 3 or len(record.time) < 100:
        return record
    dt = float(np.median(np.diff(record.time)))
    late = np.zeros(len(record.time))
    band = min(chosen_band(record.q, dt, MOTION_RATIO / NOISE_RATIO), 0.5 * WIDEST / dt)
    record = _with_even_times(record, band, dt)
    before, _ = _deviations(record, late, band, dt)
    for _ in range(ROUNDS):
        deviation, velocity = _deviations(record, late, band, dt)
        # The stamp is later than the sample, so the sampled position lags the motion at the time
        # of the stamp by q̇ δ; δ is near zero where no joint moves, since nothing determines it.
        noise = np.var(deviation, axis=0) / 10.0 + 1e-30
        info = (velocity**2 / noise).sum(axis=1) + 1.0 / (0.1 * dt) ** 2
        late = late - (velocity * deviation / noise).sum(axis=1) / info
        late = np.clip(late - late.mean(), -0.3 * dt, 0.3 * dt)
    after, _ = _deviations(record, late, band, dt)
    ratio = _share(record, after, before)
    time = record.time - late
    believed = ratio < 1.0 - EXPLAINED_FRACTION and late.std() > LEAST_ERROR * dt
    if not believed or not np.all(np.diff(time) > 0.0):
        return record
    note = (
        f"time stamps were off by {1e3 * late.std():.2g} ms (standard deviation), which explains "
        f"{1.0 - ratio:.0%} of the positions' noise; they are corrected"
    )
    return replace(record, time=read_only(time), notes=(*record.notes, note))


def _with_even_times(record: JointRecord, band: float, dt: float) -> JointRecord:
    """The recording at even times if these explain the noise of its positions."""
    even = np.linspace(record.time[0], record.time[-1], len(record.time))
    off = float((record.time - even).std())
    if off < LEAST_ERROR * dt:
        return record
    corrected = replace(record, time=read_only(even))
    step = float(even[1] - even[0])
    before, _ = _deviations(record, 0.0, band, dt)
    after, _ = _deviations(corrected, 0.0, band, step)
    ratio = _share(record, after, before)
    if ratio >= 1.0 - EXPLAINED_FRACTION:
        return record
    note = (
        f"samples are evenly spaced, but time stamps were off by {1e3 * off:.2g} ms (standard "
        f"deviation), which explains {1.0 - ratio:.0%} of the positions' noise; they are corrected"
    )
    return replace(corrected, notes=(*record.notes, note))


def _share(record: JointRecord, after: Array, before: Array) -> float:
    """Ratio of the power of deviations, in the median over the joints that move."""
    moving = record.q.std(axis=0) > 1e-6
    if not moving.any():
        return 1.0
    return float(np.median((after**2).mean(axis=0)[moving] / (before**2).mean(axis=0)[moving]))


def _deviations(
    record: JointRecord, delay: Array | float, band: float, dt: float
) -> tuple[Array, Array]:
    """Deviations of positions from the smoothed motion, and its velocities, shapes (k, n)."""
    low_pass, time = ZeroPhase(band, dt), record.time - delay
    grid = time[0] + dt * np.arange(round(float(time[-1] - time[0]) / dt) + 1)
    even = interpolated(grid, time, record.q)
    smooth, slope = (interpolated(time, grid, low_pass(even, order)) for order in (0, 1))
    return record.q - smooth, slope
