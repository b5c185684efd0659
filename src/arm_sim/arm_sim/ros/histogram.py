# SPDX-License-Identifier: Apache-2.0
"""Counts durations by the microsecond, at the cost of an addition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_BINS = 20_000  # of 1 µs; the last one holds everything longer


@dataclass(frozen=True)
class Percentiles:
    """What a histogram says, in [s]; all zero when nothing was counted."""

    count: int
    p50: float
    p99: float
    max: float

    def __str__(self) -> str:
        """Say it in microseconds."""
        values = (f"{name} {1e6 * getattr(self, name):.0f}" for name in ("p50", "p99", "max"))
        return ", ".join(values) + " µs"


class Histogram:
    """Durations in whole microseconds; exact up to 20 ms, and the longest one at any length."""

    def __init__(self) -> None:
        """Start empty."""
        self._counts = [0] * _BINS
        self._max = 0

    def add(self, nanoseconds: int) -> None:
        """Count one duration in [ns]."""
        self._counts[min(max(nanoseconds, 0) // 1000, _BINS - 1)] += 1
        if nanoseconds > self._max:
            self._max = nanoseconds

    def percentiles(self) -> Percentiles:
        """Summarise what was counted so far."""
        below = np.cumsum(self._counts)
        count = int(below[-1])
        p50, p99 = (1e-6 * int(np.searchsorted(below, share * count)) for share in (0.5, 0.99))
        return Percentiles(count, p50, p99, 1e-9 * self._max)
