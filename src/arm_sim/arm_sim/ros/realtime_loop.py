# SPDX-License-Identifier: Apache-2.0
"""A thread that calls a function at absolute deadlines and measures its lateness."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from ctypes import Structure, addressof, c_double, c_int64, c_void_p
from dataclasses import dataclass
from typing import Any

from arm_dynamics.ros.common.privileges import shorten_slice
from arm_sim.ros.latency import Histogram, Percentiles

CATCH_UP, SKIP, SLOW_DOWN = "catch_up", "skip", "slow_down"
OVERRUN = (CATCH_UP, SKIP, SLOW_DOWN)
_PR_SET_TIMERSLACK = 29


@dataclass(frozen=True)
class LoopReport:
    """Timing of a loop since it started or was reset.

    Attributes:
        ticks: Number of calls.
        elapsed: Elapsed time in [s].
        missed: Ticks that began after the next one was due.
        dropped: Deadlines that were dropped, skipped or shifted.
        lateness: Delays of ticks after their deadlines.
    """

    ticks: int
    elapsed: float
    missed: int
    dropped: int
    lateness: Percentiles

    @property
    def rate(self) -> float:
        """Ticks per second."""
        return self.ticks / self.elapsed if self.elapsed else 0.0


class Due(Structure):
    """Deadlines of ticks, in [ns].

    Attributes:
        deadline: Deadline of the next tick.
        earliest: Earliest start of the next tick.
        period: Time between deadlines; 0: there are none.
        closest: Shortest time between ticks.
        give_up: Lag beyond which deadlines are dropped, skipped or shifted.
        slow_down: Whether they are shifted.
        missed: Ticks that began after the next one was due.
        dropped: Deadlines that were dropped, skipped or shifted.
        ended: Nonzero: no more ticks.
        current: Deadline of the tick that was begun last; 0: there is none.
        began: When it began.
        share: Part of a period by which it made time pass, see ``RealtimeLoop.share``.
        lateness: Address of the histogram of the delays of ticks after their deadlines.
    """

    _fields_ = (
        ("deadline", c_int64), ("earliest", c_int64), ("period", c_int64), ("closest", c_int64),
        ("give_up", c_int64), ("slow_down", c_int64), ("missed", c_int64), ("dropped", c_int64),
        ("ended", c_int64), ("current", c_int64), ("began", c_int64), ("share", c_double),
        ("lateness", c_void_p),
    )  # fmt: skip


class RealtimeLoop:
    """Calls ``tick`` every ``period``, by deadlines that do not drift.

    ``overrun`` declares what follows a tick that begins after the next deadline:

    * ``catch_up``: the following ticks are faster, but at least ``closest`` of a period apart, so
      that partners can answer each of them. The loop is never more than ``give_up`` behind: older
      deadlines are dropped, and counted.
    * ``skip``: deadlines that have passed are skipped; ticks stay on the grid of the clock.
    * ``slow_down``: the grid is shifted; the next tick begins a period after the late one.

    With a period of zero, ticks follow one another as fast as they can, and nothing is late.

    Args:
        tick: Function to call; it must not raise.
        period: Time between deadlines in [s]; 0: none.
        overrun: ``catch_up``, ``skip`` or ``slow_down``.
        closest: Shortest time between ticks while catching up, as a fraction of the period.
        give_up: Lag in [s] beyond which deadlines are dropped while catching up.
        prepare: Called once by the thread, before its first tick.
        ahead: Executes due ticks until one is left to ``tick`` or ``Due.ended``; returns whether
            none is left yet.
        clock: Clock with sleep; the module ``time`` or an equivalent.

    Attributes:
        lateness: Delays of ticks after their deadlines.
        current: Deadline of the tick that was begun last, in [ns] of the clock; 0: none.
    """

    _until: int | None

    def __init__(
        self,
        tick: Callable[[], None],
        period: float,
        *,
        overrun: str = CATCH_UP,
        closest: float = 0.1,
        give_up: float = 1.0,
        prepare: Callable[[], None] = lambda: None,
        ahead: Callable[[Due], bool] = lambda due: False,
        clock: Any = time,
    ) -> None:
        self._tick, self._prepare, self._clock, self._ahead = tick, prepare, clock, ahead
        self._period = round(1e9 * period)
        closest = round(1e9 * period * closest) if overrun == CATCH_UP else 0
        give_up = round(1e9 * give_up) if overrun == CATCH_UP else self._period
        self._due = Due(
            period=self._period, closest=closest, give_up=give_up, slow_down=overrun == SLOW_DOWN,
            share=1.0,
        )  # fmt: skip
        self.current = c_int64.from_buffer(self._due, Due.current.offset)
        self._thread: threading.Thread | None = None
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

    @property
    def share(self) -> float:
        """Part of a period that passed before the tick that was begun last, for its partners.

        Less than one while the loop catches up: a partner that answers ten times a second cannot
        answer ten times as often then. Time in which the loop stood still counts no more than a
        period: nobody was asked meanwhile.
        """
        return float(self._due.share)

    def _run(self) -> None:
        _ask_for_exact_timers()
        shorten_slice()
        self._prepare()
        self.reset()
        once = self._by_the_clock if self._period else self._at_once
        self._due.deadline = self._due.earliest = self._clock.monotonic_ns()
        while not self._due.ended:
            if not self._ahead(self._due):
                once()

    def _at_once(self) -> None:
        self.lateness.add(0)
        self._tick()

    def _by_the_clock(self) -> None:
        due = self._due
        wake = max(due.deadline, due.earliest)
        now = self._clock.monotonic_ns()
        if now < wake:
            self._clock.sleep(1e-9 * (wake - now))
            now = self._clock.monotonic_ns()
        late = now - due.deadline
        self.lateness.add(late)
        due.missed += late > self._period
        due.share = min(1.0, (now - due.began) / self._period) if late > self._period else 1.0
        due.current, due.began, due.earliest = due.deadline, now, now + due.closest
        self._tick()
        due.deadline += self._period
        if late > due.give_up:
            due.deadline += self._shift(late)

    def _shift(self, late: int) -> int:
        """Shift of the next deadline."""
        if self._due.slow_down:
            self._due.dropped += late // self._period
            return late
        dropped = -(-(late - self._due.give_up) // self._period)
        self._due.dropped += dropped
        return dropped * self._period


def _ask_for_exact_timers() -> None:
    """Reduce the kernel's timer slack of this thread, 50 µs by default, if possible."""
    try:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    except (OSError, AttributeError):
        pass  # not Linux: ticks are up to 50 µs later
