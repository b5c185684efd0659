# SPDX-License-Identifier: Apache-2.0
"""Efforts that a sensor or a driver did not measure: frozen ones, and saturated ones."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_studies.identification.data import JointRecord, row_words, runs

SATURATED = 8  # Number of consecutive samples at the same extreme effort that indicate saturation.
# Departure of a position from uniform motion in [rad] or [m] from which an effort that does not
# change is frozen: in uniform motion it may be constant.
DEPARTURE = 1e-3
# Change after which an effort was frozen, over its typical change, if that is less than ``COARSE``
# times its small ones: those of a coarse sensor are all alike, and its long runs end with one of
# them.
JUMP, COARSE = 3.0, 3.0


def without_frozen(record: JointRecord, start: float) -> tuple[JointRecord, list[str]]:
    """The record without efforts that did not change while the joint's speed did, and notes."""
    effort, notes = np.array(record.effort), []
    for j, name in enumerate(record.joint_names):
        stale = _frozen(record.q[:, j], effort[:, j])
        if stale.any():
            effort[stale, j] = np.nan
            notes.append(
                f"'{name}': effort frozen in {row_words(stale, record.time - start)} while the "
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


def saturated(effort: Array) -> NDArray[np.bool_]:
    """Samples in long runs of one and the same extreme value, shape (k, n)."""
    clipped = np.zeros(effort.shape, bool)
    for i, column in enumerate(effort.T):
        least, largest = np.nanmin(column, initial=np.inf), np.nanmax(column, initial=-np.inf)
        for extreme in (least, largest) if least < largest else ():  # ``checks`` refuses constants
            for start, end in runs(column == extreme):
                clipped[start:end, i] |= end - start >= SATURATED
    return clipped
