# SPDX-License-Identifier: Apache-2.0
"""Latency: a histogram of durations, and the round trip of commands."""

from __future__ import annotations

import math
import time
from array import array
from ctypes import Structure, addressof, c_int64, c_void_p
from dataclasses import dataclass

import numpy as np

_FINE = 20_000  # bins of 1 µs
_COARSE = 512  # bins beyond, each longer than the one before by the factor 2 ** (1 / 32)
_STEPS = 32
_REMEMBERED = 256  # number of states; answers to older ones are not counted


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

    Attributes:
        bins: Address of the counts.
        longest: The longest duration in [ns].
    """

    _fields_ = (("bins", c_void_p), ("longest", c_int64))

    def __init__(self) -> None:
        self._counts = array("q", bytes(8 * (_FINE + _COARSE)))
        # Persistent arrays: allocating large arrays every second would fragment the memory of a
        # process that runs for days.
        self._bins = np.frombuffer(self._counts, np.int64)
        self._below = np.zeros_like(self._bins)
        super().__init__(bins=self._bins.ctypes.data)

    def add(self, nanoseconds: int) -> None:
        """Count one duration in [ns]."""
        micro = nanoseconds // 1000
        if micro >= _FINE:
            micro = _FINE + min(int(_STEPS * math.log2(micro / _FINE)), _COARSE - 1)
        self._counts[micro if micro > 0 else 0] += 1
        if nanoseconds > self.longest:
            self.longest = nanoseconds

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

    Attributes:
        newest: Stamp of the state published last, in [ns].
        next: Index of the next state in the ring buffer.
        stamps: Address of the stamps in [ns], -1: answered.
        times: Address of the system times of publication, in [ns].
        trips: Address of the histogram.
    """

    _fields_ = (
        ("newest", c_int64), ("next", c_int64),
        ("stamps", c_void_p), ("times", c_void_p), ("trips", c_void_p),
    )  # fmt: skip

    def __init__(self) -> None:
        self._stamps, self._times = array("q", [-1] * _REMEMBERED), array("q", [0] * _REMEMBERED)
        places = (numbers.buffer_info()[0] for numbers in (self._stamps, self._times))
        super().__init__(0, 0, *places)
        self.reset()

    def reset(self) -> None:
        """Reset the counters."""
        self._histogram = Histogram()
        self.trips = addressof(self._histogram)

    def sent(self, stamp: int) -> None:
        """Register that the state of ``stamp`` in [ns] is published now."""
        place = self.next
        self._stamps[place], self._times[place] = stamp, time.time_ns()
        self.newest, self.next = stamp, (place + 1) % _REMEMBERED

    def answered(self, stamp: int, arrival: int) -> None:
        """Register that a command for the state of ``stamp`` arrived; only the first one counts.

        Args:
            stamp: Time of the state in [ns].
            arrival: System time of arrival in [ns].
        """
        if stamp not in self._stamps:
            return
        place = self.next
        while self._stamps[place := (place - 1) % _REMEMBERED] != stamp:
            pass  # the newest of that stamp: time may have been reset
        self._stamps[place] = -1
        self._histogram.add(arrival - self._times[place])

    def percentiles(self) -> Percentiles:
        """Summary of the answers so far."""
        return self._histogram.percentiles()
