# SPDX-License-Identifier: Apache-2.0
"""Stamps of the sim node's messages: simulated time, or time of the node's clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from ctypes import Structure, addressof, c_int64, c_void_p
from typing import Any

AUTO, ROS, SIM = "auto", "ros", "sim"
CHOICES = (AUTO, ROS, SIM)
_WINDOW = 1_000_000_000  # [ns] over which the smallest lag is determined
_NEVER = 1 << 62
_NUMBERS = ("tick", "even", "free", "simulated", "last", "offset", "least", "look", "owed")


class SimulatedTime:
    """Stamps that are simulated time: the number of ticks times their length."""

    name = SIM

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time."""
        return simulated

    near = at

    def see(self) -> None:
        """Nothing to do: there is no clock."""

    def release(self) -> None:
        """Nothing to do: simulated time never lags."""

    def follow(self, due: c_int64) -> None:
        """Nothing to do: it does not matter when ticks are due."""


class NodeTime(Structure):
    """Stamps of the node's clock, in steps of the tick, also while the loop catches up.

    A real-time thread wakes up about 50 µs late, with jitter. If stamps were the time of waking,
    the reference of a controller would jitter by velocity times that time: a Panda that moves by
    half a radian in two seconds would have an error of 2e-4 to 3e-4 rad instead of 3e-6 (RMS, on
    a busy machine). So the stamp of a tick is the time when it is *due*: simulated time plus an
    offset, where

    * no stamp lies in the future: the offset is reduced if one would;
    * no stamp lags behind the time when its tick was due by more than a tick for long: if the
      smallest lag of a second is longer, as after dropped ticks, stamps advance 1.5 times as fast
      until the lag is recovered, and jump if it exceeds a second. A loop that is late makes up for
      that itself, so its lateness is no lag;
    * stamps do not go backwards, not even when simulated time is reset, unless the clock is set
      back by more than a second.

    If ticks are not due at even times, or the clock is another node's simulated time, stamps are
    the time of the clock.

    Args:
        clock: The node's ``rclpy.clock.Clock``.
        tick: Length of a tick in [ns] if ticks are due at even times, else 0.
        system: Time of the system in [ns].
        steady: Time of the monotonic clock in [ns].

    Attributes:
        tick: As above.
        even: Whether stamps are simulated time plus an offset.
        free: Whether the next stamp is the time when its tick is due, whatever the offset was.
        simulated: Simulated time of the last stamp in [ns].
        last: The last stamp in [ns].
        offset: Stamp of simulated time zero in [ns].
        least: Smallest lag since the last check in [ns].
        look: Time of the next check, in [ns].
        owed: Lag that remains to be recovered in [ns].
        due: Address of the time when the current tick was due, see ``follow``.
    """

    _fields_ = (*((name, c_int64) for name in _NUMBERS), ("due", c_void_p))
    name = ROS

    def __init__(
        self,
        clock: Any,
        tick: int,
        system: Callable[[], int] = time.time_ns,
        steady: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        super().__init__(tick=tick, simulated=-1, least=_NEVER, free=True)
        self._clock, self._system, self._steady = clock, system, steady
        self.follow(c_int64())
        self.see()

    def follow(self, due: c_int64) -> None:
        """Read in ``due`` from now on when the current tick was due, in [ns] of the steady clock.

        Zero: this is unknown, and ticks are not late.
        """
        self._due, self.due = due, addressof(due)

    def release(self) -> None:
        """After time stood still, the next stamp is that of the clock."""
        self.free = True

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time; time that stands still stays."""
        passed = simulated - self.simulated
        free, self.free = self.free or passed < 0, False
        if passed == 0 and not free:
            return self.last
        now = self._now()
        due, stamp = now - self._lateness(), now
        if self.even:
            stamp = self._first(due, passed) if free else self._next(now, simulated)
            if stamp < self.last < stamp + _WINDOW:
                stamp = self.last
        self.last, self.simulated, self.offset = stamp, simulated, stamp - simulated
        self._watch(now, due - stamp)
        return stamp

    def _first(self, due: int, passed: int) -> int:
        """The stamp after time stood still or began anew; before its tick, a tick older."""
        self.owed = 0
        return due if passed > 0 else due - self.tick

    def _next(self, now: int, simulated: int) -> int:
        """The stamp after another one, ahead by a part of what is owed."""
        more = min(self.owed, (simulated - self.simulated) // 2)
        self.owed -= more
        return min(now, simulated + self.offset + more)

    def _lateness(self) -> int:
        """Time since the current tick was due in [ns].

        Read after the system's clock: if the thread is stopped between the two, no stamp is later
        than it should be.
        """
        due = self._due.value
        return self._steady() - due if self.even and due else 0

    def near(self, simulated: int) -> int:
        """As ``at``, for a time close to that of the last stamp, in any thread."""
        return int(simulated + self.offset)

    def _now(self) -> int:
        # The node's clock is the system's unless use_sim_time is set; asking rclpy takes 6 µs.
        return int(self._clock.now().nanoseconds) if self._foreign else self._system()

    def _watch(self, now: int, lag: int) -> None:
        if lag < self.least:
            self.least = lag
        if now >= self.look:
            behind = self.least if self.tick < self.least < _NEVER else 0
            jumps = behind > _WINDOW
            self.offset, self.owed = self.offset + behind * jumps, behind * (not jumps)
            self.least, self.look = _NEVER, now + _WINDOW
            self.see()

    def see(self) -> None:
        """Determine the source of the node's clock."""
        self._foreign = bool(self._clock.ros_time_is_active)
        self.even = bool(self.tick) and not self._foreign
