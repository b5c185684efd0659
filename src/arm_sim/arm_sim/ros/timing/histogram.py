# SPDX-License-Identifier: Apache-2.0
"""A histogram of durations, which C counts, and its percentiles."""

from ctypes import Structure
from dataclasses import dataclass

import numpy as np

from arm_sim.ros.node_library import TIMING

_FINE, _COARSE = TIMING.constants["FINE_BINS"], TIMING.constants["COARSE_BINS"]
_PER_OCTAVE = TIMING.constants["BINS_PER_OCTAVE"]


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

    ``histogram_t`` of timing.h; ``longest`` is the longest duration in [ns].
    """

    _fields_ = TIMING.fields("histogram_t")

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
    return float(1e-6 * _FINE * 2.0 ** ((bin_ - _FINE) / _PER_OCTAVE))
