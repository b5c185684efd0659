# SPDX-License-Identifier: Apache-2.0
"""A thread that ticks at absolute deadlines and measures its lateness."""

import ctypes
import threading
import time
from collections.abc import Callable
from ctypes import addressof, c_int64
from dataclasses import dataclass
from typing import Any

from arm_dynamics.ros.common.threads.scheduling import shorten_slice
from arm_sim.ros.node_library import TIMING
from arm_sim.ros.timing.histogram import Histogram, Percentiles

CATCH_UP, SKIP, SLOW_DOWN = "catch_up", "skip", "slow_down"
OVERRUN = (CATCH_UP, SKIP, SLOW_DOWN)
_PR_SET_TIMERSLACK = 29  # of prctl: by how much a thread may wake up later, in [ns]


@dataclass(frozen=True)
class LoopReport:
    """Timing of a loop since it started or was reset."""

    ticks: int
    elapsed: float  # [s]
    missed: int  # ticks that began after the next one was due
    dropped: int  # deadlines that were dropped, skipped or shifted
    lateness: Percentiles  # delays of ticks after their deadlines

    @property
    def rate(self) -> float:
        """Ticks per second."""
        return self.ticks / self.elapsed if self.elapsed else 0.0


# Deadlines of ticks, in [ns]: ``due_t`` of timing.h, where the fields are explained
Due = TIMING.structure("due_t")


class RealtimeLoop:
    """Ticks every ``period``, by deadlines that do not drift.

    While it catches up, a tick makes time pass for partners only in part (``Due.share``): one that
    answers ten times a second cannot answer ten times as often then. Time in which the loop stood
    still counts no more than a period: nobody was asked meanwhile.

    ``overrun`` declares what follows a tick that begins after the next deadline:

    * ``catch_up``: the following ticks are faster, but at least ``spacing`` of a period apart, so
      that partners can answer each of them. The loop is never more than ``longest_lag`` behind:
      older deadlines are dropped, and counted.
    * ``skip``: deadlines that have passed are skipped; ticks stay on the grid of the clock.
    * ``slow_down``: the grid is shifted; the next tick begins a period after the late one.

    With a period of zero, ticks follow one another as fast as they can, and nothing is late.

    Args:
        run: Waits for ticks, begins them by ``due_begin_tick`` of timing.h and executes them,
            until ``Due.ended``, or returns after one of them; it must not raise.
        period: Time between deadlines in [s]; 0: none.
        overrun: ``catch_up``, ``skip`` or ``slow_down``.
        spacing: Shortest time between ticks while catching up, as a fraction of the period.
        longest_lag: Lag in [s] beyond which deadlines are dropped while catching up.
        prepare: Called once by the thread, before its first tick.
        clock: Clock of the deadlines; the module ``time`` or an equivalent.

    Attributes:
        lateness: Delays of ticks after their deadlines.
        current: Deadline of the tick that was begun last, in [ns] of the clock; 0: none.
    """

    def __init__(
        self, run: Callable[[Any], None], period: float, *, overrun: str = CATCH_UP,
        spacing: float = 0.1, longest_lag: float = 1.0, prepare: Callable[[], None] = lambda: None,
        clock: Any = time,
    ) -> None:  # fmt: skip
        self._execute, self._prepare, self._clock = run, prepare, clock
        period_ns = round(1e9 * period)
        spacing_ns = round(1e9 * period * spacing) if overrun == CATCH_UP else 0
        # Without catching up, a tick that begins after the next deadline is late beyond recovery.
        longest_lag_ns = round(1e9 * longest_lag) if overrun == CATCH_UP else period_ns
        self._due = Due(
            period=period_ns, spacing=spacing_ns, longest_lag=longest_lag_ns,
            slow_down=overrun == SLOW_DOWN, share=1.0,
        )  # fmt: skip
        self.current = c_int64.from_buffer(self._due, Due.current.offset)
        self._thread: threading.Thread | None = None
        self._until: int | None = None
        self.reset()

    def start(self) -> None:
        """Start ticking in a thread of its own."""
        self._due.ended = 0
        self._thread = threading.Thread(target=self._run, name="realtime_loop", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop after the current tick; the report is kept."""
        self._due.ended = 1
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        if self._until is None:
            self._until = self._clock.monotonic_ns()

    def reset(self) -> None:
        """Reset the counters."""
        self.lateness = Histogram()
        self._due.lateness = addressof(self.lateness)
        self._due.missed = self._due.dropped = 0
        self._since, self._until = self._clock.monotonic_ns(), None

    def report(self) -> LoopReport:
        """Timing so far."""
        lateness = self.lateness.percentiles()
        elapsed = 1e-9 * ((self._until or self._clock.monotonic_ns()) - self._since)
        return LoopReport(lateness.count, elapsed, self._due.missed, self._due.dropped, lateness)

    def _run(self) -> None:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)  # else 50 µs late
        shorten_slice()
        self._prepare()
        self.reset()
        self._due.deadline = self._due.earliest = self._clock.monotonic_ns()
        while not self._due.ended:
            self._execute(self._due)
