# SPDX-License-Identifier: Apache-2.0
"""Slices of a long run, so short that Ctrl-C acts soon: between calls of compiled code."""

from collections.abc import Iterator
from time import perf_counter

DURATION = 0.02  # [s] that a slice should take
GROWTH = 4.0  # at most, of one slice to the next: if ticks then take ten times as long it is short


def slices(count: int, first: int) -> Iterator[tuple[int, int]]:
    """Beginnings and ends of slices of ``count`` rows, of which the first has ``first``."""
    start, size = 0, first
    while start < count:
        end, begin = min(count, start + size), perf_counter()
        yield start, end
        elapsed = max(perf_counter() - begin, 1e-9)
        size = max(1, int((end - start) * min(GROWTH, DURATION / elapsed)))
        start = end
