# SPDX-License-Identifier: Apache-2.0
"""Latency: a histogram of durations, and the round trip of commands."""

from __future__ import annotations

from ctypes import Structure, addressof, byref
from dataclasses import dataclass

import numpy as np

from arm_sim.ros.node_library import LOOP, library

_FINE, _COARSE, _STEPS, _SENT = (LOOP.constants[n] for n in ("FINE", "COARSE", "STEPS", "SENT"))


@dataclass(frozen=True)
class Percentiles:
    """Summary of a histogram, in [s]; all zero if it is empty."""

    count: int
    p50: float
    p99: float
    max: float

    def __str__(self) -> str:
        """In microseconds."""
        values = (f"{name} {1e6 * getattr(self, name):.0f}" for name in ("p50", "p99", "max"))
        return ", ".join(values) + " µs"


class Histogram(Structure):
    """Durations: exact to a microsecond up to 20 ms, to two percent up to 20 minutes.

    ``histogram_t`` of loop.h; ``longest`` is the longest duration in [ns].
    """

    _fields_ = LOOP.fields("histogram_t")

    def __init__(self) -> None:
        # Persistent arrays: allocating large arrays every second would fragment the memory of a
        # process that runs for days.
        self._bins = np.zeros(_FINE + _COARSE, np.int64)
        self._below = np.zeros_like(self._bins)
        super().__init__(bins=self._bins.ctypes.data)

    def percentiles(self) -> Percentiles:
        """Summarize the durations so far; for one thread at a time."""
        below = np.cumsum(self._bins, out=self._below)
        count = int(below[-1])
        p50, p99 = (_seconds(int(np.searchsorted(below, share * count))) for share in (0.5, 0.99))
        longest = 1e-9 * self.longest
        return Percentiles(count, min(p50, longest), min(p99, longest), longest)

    def bars(self) -> tuple[tuple[float, int], ...]:
        """Upper edge in [s] and count of every bin that is not empty."""
        bins = self._bins
        return tuple((_seconds(int(i) + 1), int(bins[i])) for i in np.flatnonzero(bins))


def _seconds(bin_: int) -> float:
    if bin_ < _FINE:
        return 1e-6 * bin_
    return float(1e-6 * _FINE * 2.0 ** ((bin_ - _FINE) / _STEPS))


class RoundTrip(Structure):
    """Time from a joint state to the command with its stamp.

    ``trip_t`` of loop.h; ``newest`` is the stamp of the state published last, in [ns].
    """

    _fields_ = LOOP.fields("trip_t")

    def __init__(self) -> None:
        self._stamps, self._times = np.full(_SENT, -1), np.zeros(_SENT, np.int64)
        super().__init__(stamps=self._stamps.ctypes.data, times=self._times.ctypes.data)
        self.reset()

    def reset(self) -> None:
        """Reset the counters."""
        self._histogram = Histogram()
        self.trips = addressof(self._histogram)

    def answered(self, stamp: int, arrival: int) -> bool:
        """Register when, in [ns] of the system, a command for a state arrived: the first counts.

        Returns:
            Whether that state is the newest.
        """
        return bool(library().answered(byref(self), stamp, arrival))

    def awaits(self, stamp: int) -> bool:
        """Whether a state of ``stamp`` in [ns] was published lately and has no answer yet."""
        return stamp >= 0 and stamp in self._stamps

    def forget(self) -> None:
        """Forget the answer that acts: time stands still, or something else acts."""
        self.acting = 0

    def take_oldest(self) -> float:
        """The oldest age in [s] of the arm's time at which an answer acted since the last call."""
        oldest, self.oldest = self.oldest, 0
        return float(1e-9 * oldest)

    def percentiles(self) -> Percentiles:
        """Summary of the answers so far."""
        return self._histogram.percentiles()
