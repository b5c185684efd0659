# SPDX-License-Identifier: Apache-2.0
"""Stretches of a recording without gaps, and their samples at even times."""

from dataclasses import replace

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.exceptions import InvalidInput
from arm_studies.identification.data import JointRecord, in_words, interpolated

# Steps without a sample that split a recording; over shorter holes the filter gets interpolated
# values, and only the samples that are missing are left out.
GAP = 4.5
EFFORT_REACH = 0.5  # Steps from a sample up to which an effort is known.
SHORTEST = 100  # Smallest number of samples of a stretch.
# Fraction of a step by which samples may be off an even grid without being interpolated.
GRID_TOLERANCE = 1e-3
# Relative difference from the median step below which the mean is the step.
STEP_TOLERANCE = 0.02


def pieces(record: JointRecord, step: float, start: float) -> tuple[list[JointRecord], list[str]]:
    """Stretches without a gap that are long enough, and notes of the gaps.

    Raises:
        InvalidInput: If there is none.
    """
    cuts, notes = np.flatnonzero(np.diff(record.time) > GAP * step) + 1, []
    if cuts.size:
        gaps = np.column_stack([record.time[cuts - 1], record.time[cuts]]) - start
        notes.append(f"the motion has gaps ({in_words(gaps)}); nothing is used near them")
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


def mean_step(stretches: list[JointRecord], step: float) -> float:
    """The mean step in [s] if times are even, so that no drift adds up; else the median.

    Args:
        stretches: All stretches of a recording.
        step: The median.
    """
    longest = max(stretches, key=lambda stretch: len(stretch.time))
    steps = float(np.rint(np.diff(longest.time) / step).sum())  # also over rows that are missing
    mean = float(longest.time[-1] - longest.time[0]) / max(steps, 1.0)
    return mean if abs(mean - step) < STEP_TOLERANCE * step else step


def at_even_times(piece: JointRecord, step: float) -> JointRecord:
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
    q = cubic(time, piece.time, piece.q, slopes)
    time, q, effort, v, a = map(read_only, (time, q, effort, v, a))
    return replace(piece, time=time, q=q, effort=effort, v=v, a=a)


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
