# SPDX-License-Identifier: Apache-2.0
"""A thread that calls a function at absolute deadlines and measures how well it keeps them."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from ctypes import Structure, addressof, c_int64, c_void_p
from dataclasses import dataclass
from typing import Any

from arm_sim.ros.latency import Histogram, Percentiles

CATCH_UP, SKIP, SLOW_DOWN = "catch_up", "skip", "slow_down"
OVERRUN = (CATCH_UP, SKIP, SLOW_DOWN)
_PR_SET_TIMERSLACK = 29


@dataclass(frozen=True)
class LoopReport:
    """How a loop has kept its deadlines since it started or was reset.

    Attributes:
        ticks: Calls made.
        elapsed: Time they took in [s].
        missed: Ticks that began after the next one was due.
        dropped: Deadlines that were given up, left out or shifted.
        lateness: How long after their deadline ticks began.
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
    """When ticks are due, in [ns].

    Attributes:
        deadline: When the next one is.
        earliest: Before that it does not begin.
        period: From deadline to deadline; 0: there are none.
        closest: Least distance of ticks.
        give_up: Lag beyond which deadlines are dropped, left out or shifted.
        slow_down: Whether they are shifted.
        missed: Ticks that began after the next one was due.
        dropped: Deadlines that were dropped, left out or shifted.
        lateness: Address of the histogram of how long after their deadline ticks began.
    """

    _fields_ = (
        ("deadline", c_int64), ("earliest", c_int64), ("period", c_int64), ("closest", c_int64),
        ("give_up", c_int64), ("slow_down", c_int64), ("missed", c_int64), ("dropped", c_int64),
        ("lateness", c_void_p),
    )  # fmt: skip


class RealtimeLoop:
    """Calls ``tick`` every ``period``, by deadlines that do not drift.

    What follows a tick that begins after the next one was due is declared by ``overrun``:

    * ``catch_up``: it is made up for. The following ticks come faster, though never closer than
      ``closest`` of a period, so that partners still get to answer each of them. The loop is never
      more than ``give_up`` behind: older deadlines are dropped, and counted.
    * ``skip``: deadlines that have passed are left out; ticks stay on the grid of the clock.
    * ``slow_down``: the grid itself is shifted; the next tick comes a period after the late one.

    With a period of zero, ticks follow one another as fast as they can, and nothing is late.

    Args:
        tick: What to call; it must not raise.
        period: Time between deadlines in [s]; 0: none.
        overrun: ``catch_up``, ``skip`` or ``slow_down``.
        closest: Least distance of ticks while catching up, as a part of the period.
        give_up: Lag in [s] beyond which deadlines are dropped while catching up.
        prepare: Called once by the thread, before its first tick.
        ahead: Makes ticks that are due until one is not for it, and returns whether there is none
            yet that is to be made by ``tick``.
        clock: What tells the time and sleeps; the module ``time`` or the like.

    Attributes:
        lateness: How long after their deadline ticks began.
    """

    _until: int | None

    def __init__(
        self,
        tick: Callable[[], None],
        period: float,
        *,
        overrun: str = CATCH_UP,
        closest: float = 0.35,
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
            period=self._period, closest=closest, give_up=give_up, slow_down=overrun == SLOW_DOWN
        )
        self._thread: threading.Thread | None = None
        self._running = False
        self.reset()

    def start(self) -> None:
        """Start ticking in a thread of its own."""
        self._running = True
        self._thread = threading.Thread(target=self._run, name="realtime_loop", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop after the tick under way; the report stays."""
        self._running = False
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        if self._until is None:
            self._until = self._clock.monotonic_ns()

    def reset(self) -> None:
        """Begin counting anew."""
        self.lateness = Histogram()
        self._due.lateness = addressof(self.lateness)
        self._due.missed = self._due.dropped = 0
        self._since, self._until = self._clock.monotonic_ns(), None

    def report(self) -> LoopReport:
        """How well deadlines were kept."""
        lateness = self.lateness.percentiles()
        elapsed = 1e-9 * ((self._until or self._clock.monotonic_ns()) - self._since)
        return LoopReport(lateness.count, elapsed, self._due.missed, self._due.dropped, lateness)

    def _run(self) -> None:
        _ask_for_exact_timers()
        self._prepare()
        self.reset()
        once = self._by_the_clock if self._period else self._at_once
        self._due.deadline = self._due.earliest = self._clock.monotonic_ns()
        while self._running:
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
        due.earliest = now + due.closest
        self._tick()
        due.deadline += self._period
        if late > due.give_up:
            due.deadline += self._shift(late)

    def _shift(self, late: int) -> int:
        """How much later the next deadline is than it would have been."""
        if self._due.slow_down:
            self._due.dropped += late // self._period
            return late
        dropped = -(-(late - self._due.give_up) // self._period)
        self._due.dropped += dropped
        return dropped * self._period


def _ask_for_exact_timers() -> None:
    """Lower the kernel's timer slack of this thread, 50 µs by default, where that is possible."""
    try:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    except (OSError, AttributeError):
        pass  # not Linux: ticks come up to 50 µs later
