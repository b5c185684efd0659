# SPDX-License-Identifier: Apache-2.0
"""What long runs say and how often they let go: progress, signals, and memory.

Python handles signals, such as that of Ctrl-C, between calls of compiled code: a run makes so many
ticks in one call as take some hundredths of a second.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import current_thread, main_thread
from time import perf_counter
from typing import Self

from arm_dynamics import InvalidInput

SLICE, GROWTH = 0.02, 4.0
"""Time that a slice should take in [s], and the largest ratio of the lengths of two of them: a
slice that is ten times as slow as the last one is still short."""
PATIENCE, REDRAWN = 2.0, 0.2
"""Time in [s] without a word, and between two of them on a terminal."""
ALLOWED = 0.5
"""Share of the available memory that a recording may take."""
_RECORD = "record(path, duration, …) writes it to a file as it is made, or run it in parts"
_SMALL = 100_000_000  # [B] that need no look at the memory
_CONTAINER = (
    Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes")
)  # fmt: skip

_log = logging.getLogger(__name__)


def slices(count: int, first: int) -> Iterator[tuple[int, int]]:
    """Beginnings and ends of slices of ``count`` rows, of which the first has ``first``."""
    done, size = 0, first
    while done < count:
        end, begin = min(count, done + size), perf_counter()
        yield done, end
        taken = max(perf_counter() - begin, 1e-9)
        size = max(1, int((end - done) * min(GROWTH, SLICE / taken)))
        done = end


class Progress:
    """The progress of a run of simulated time; nothing is said for two seconds.

    On a terminal and in a notebook it is a line on stderr that is overwritten and goes in the end.
    Where messages of level INFO are logged, it is one of them after 2, 4, 8 … seconds instead; a
    level above WARNING silences both.

    Args:
        total: Simulated time of the run in [s].

    Example:
        >>> with Progress(100.0) as progress:
        ...     progress.tell(10.0)
    """

    def __init__(self, total: float) -> None:
        self._total, self._begin = total, perf_counter()
        self._due, self._shown = self._begin + PATIENCE, 0

    def tell(self, done: float) -> None:
        """Say how much is done, of the simulated time in [s]."""
        if (now := perf_counter()) < self._due:
            return
        passed = now - self._begin
        left = (self._total - done) * passed / done if done else float("inf")
        text = (
            f"{done:.6g} of {self._total:.6g} s simulated, {done / passed:.3g} times real time, "
            f"{left:.0f} s left"
        )
        if _log.isEnabledFor(logging.INFO):
            self._due = now + passed
            _log.info("%s", text)
        else:
            self._due = now + REDRAWN
            watched = sys.stderr.isatty() or "ipykernel" in sys.modules
            alone = current_thread() is main_thread()  # no other writes there
            if watched and alone and _log.isEnabledFor(logging.WARNING):
                print(f"\r{text:{self._shown}}", end="", file=sys.stderr, flush=True)
                self._shown = len(text)

    def __enter__(self) -> Self:
        """Begin."""
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the line."""
        if self._shown:
            print(f"\r{'':{self._shown}}\r", end="", file=sys.stderr, flush=True)


def refuse_beyond_memory(ticks: int, each: int, what: str = "", instead: str = _RECORD) -> None:
    """Refuse to record more than half of the available memory holds.

    Args:
        ticks: Number of ticks.
        each: Bytes for each.
        what: What would be recorded; empty for a motion of so many ticks.
        instead: What to do instead.

    Raises:
        InvalidInput: With the size, and what to do.
    """
    if (size := ticks * each) < _SMALL or size <= ALLOWED * (available := _available()):
        return
    raise InvalidInput(
        f"{what or f'a recording of {ticks} time steps'} takes {size / 1e9:.3g} GB of memory; "
        f"allowed: {ALLOWED:.0%} of the {available / 1e9:.3g} GB that are available; {instead}"
    )


def _available() -> float:
    """Memory in [B] that is available; infinite if the system does not say it."""
    limits = [_number(path, "") for path in _CONTAINER]
    return min(1024.0 * _number(Path("/proc/meminfo"), "MemAvailable:"), *limits)


def _number(path: Path, name: str) -> float:
    """The number after a name in a file of the system; infinite if there is none."""
    try:
        text = path.read_text(encoding="ascii")
        return float(text[text.index(name) + len(name) :].split()[0])
    except (OSError, ValueError, IndexError):
        return float("inf")
