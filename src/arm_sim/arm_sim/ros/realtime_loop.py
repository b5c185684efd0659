# SPDX-License-Identifier: Apache-2.0
"""A thread that calls a function at absolute deadlines and keeps count of how well it does."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from arm_sim.ros.histogram import Histogram, Percentiles

_PR_SET_TIMERSLACK = 29


@dataclass(frozen=True)
class LoopReport:
    """How a loop has kept its deadlines since it started or was last asked afresh.

    Attributes:
        ticks: Calls made.
        elapsed: Time they took in [s].
        missed: Ticks that began after the next one was due.
        dropped: Deadlines given up because the loop was too far behind.
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


class RealtimeLoop:
    """Calls ``tick`` every ``period``, by deadlines that do not drift.

    A tick that is late is made up for: the following ones come faster, though never closer than
    ``closest`` of a period, so that partners still get to answer each of them. The loop is never
    more than ``give_up`` behind: deadlines that are older are dropped, and counted.
    """

    def __init__(
        self,
        tick: Callable[[], None],
        period: float,
        *,
        closest: float = 0.5,
        give_up: float = 1.0,
    ) -> None:
        """Prepare the loop; ``start`` runs it.

        Args:
            tick: What to call; it must not raise.
            period: Time between deadlines in [s].
            closest: Least distance of ticks while catching up, as a part of the period.
            give_up: Lag in [s] beyond which deadlines are dropped.
        """
        self._tick = tick
        self._period = round(1e9 * period)
        self._closest = round(1e9 * period * closest)
        self._give_up = round(1e9 * give_up)
        self._running = False
        self._until: int | None = None
        self._thread = threading.Thread(target=self._run, name="realtime_loop", daemon=True)
        self.forget()

    def start(self) -> None:
        """Start ticking in a thread of its own."""
        self._running = True
        self._thread.start()

    def stop(self) -> None:
        """Stop ticking and wait for the thread to end."""
        self._running = False
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()
            self._until = time.monotonic_ns()

    def forget(self) -> None:
        """Start counting afresh."""
        self._lateness = Histogram()
        self._missed = self._dropped = 0
        self._since, self._until = time.monotonic_ns(), None

    def report(self) -> LoopReport:
        """Say how well deadlines were kept."""
        lateness = self._lateness.percentiles()
        elapsed = 1e-9 * ((self._until or time.monotonic_ns()) - self._since)
        return LoopReport(lateness.count, elapsed, self._missed, self._dropped, lateness)

    def _run(self) -> None:
        _ask_for_exact_timers()
        self.forget()
        deadline = earliest = time.monotonic_ns()
        while self._running:
            wake = max(deadline, earliest)
            now = time.monotonic_ns()
            if now < wake:
                time.sleep(1e-9 * (wake - now))
                now = time.monotonic_ns()
            self._lateness.add(now - deadline)
            self._missed += now - deadline > self._period
            earliest = now + self._closest
            self._tick()
            deadline = self._next(deadline, now)

    def _next(self, deadline: int, now: int) -> int:
        too_late = now - deadline - self._give_up
        dropped = -(-too_late // self._period) if too_late > 0 else 0
        self._dropped += dropped
        return deadline + (dropped + 1) * self._period


def _ask_for_exact_timers() -> None:
    """Lower the kernel's timer slack of this thread, 50 µs by default, where that is possible."""
    try:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    except (OSError, AttributeError):
        pass  # not Linux: ticks come up to 50 µs later
