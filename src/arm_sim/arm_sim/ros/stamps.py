# SPDX-License-Identifier: Apache-2.0
"""Stamps of the sim node's messages: simulated time, or time of the node's clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from ctypes import Structure, c_int64
from typing import Any

AUTO, ROS, SIM = "auto", "ros", "sim"
CHOICES = (AUTO, ROS, SIM)
_WINDOW = 1_000_000_000  # [ns] over which the smallest lag is determined
_NEVER = 1 << 62


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


class NodeTime(Structure):
    """Stamps of the node's clock, in steps of the tick while the simulation keeps up with it.

    A real-time thread wakes up about 50 µs late, with jitter. If stamps were the time of waking,
    the reference of a controller would jitter by velocity times that time: a Panda that moves by
    half a radian in two seconds would have an error of 2e-4 to 3e-4 rad instead of 3e-6 (RMS, on
    a busy machine). So the stamp of a tick is the time when it is *due*: simulated time plus an
    offset, where

    * no stamp lies in the future: the offset is reduced if one would;
    * no stamp lags by more than a tick for long: if the smallest lag of a second is longer, as
      after dropped ticks, stamps advance 1.5 times as fast until the lag is recovered, and jump
      if it exceeds a second;
    * stamps do not go backwards, not even when simulated time is reset, unless the clock is set
      back by more than a second.

    If ticks are not due at even times, or the clock is another node's simulated time, stamps are
    the time of the clock.

    Args:
        clock: The node's ``rclpy.clock.Clock``.
        tick: Length of a tick in [ns] if ticks are due at even times, else 0.
        system: Time of the system in [ns].

    Attributes:
        tick: As above.
        even: Whether stamps are simulated time plus an offset.
        free: Whether the next stamp is the time of the clock.
        simulated: Simulated time of the last stamp in [ns].
        last: The last stamp in [ns].
        offset: Stamp of simulated time zero in [ns].
        least: Smallest lag since the last check in [ns].
        look: Time of the next check, in [ns].
        owed: Lag that remains to be recovered in [ns].
    """

    _fields_ = tuple(
        (name, c_int64) for name in "tick even free simulated last offset least look owed".split()
    )
    name = ROS

    def __init__(self, clock: Any, tick: int, system: Callable[[], int] = time.time_ns) -> None:
        super().__init__(tick=tick, simulated=-1, least=_NEVER, free=True)
        self._clock, self._system = clock, system
        self.see()

    def release(self) -> None:
        """After time stood still, the next stamp is the time of the clock."""
        self.free = True

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time; time that stands still stays."""
        free, self.free = self.free or simulated < self.simulated, False
        if simulated == self.simulated and not free:
            return self.last
        now = self._now()
        if self.owed:
            more = min(self.owed, (simulated - self.simulated) // 2)
            self.owed, self.offset = self.owed - more, self.offset + more
        even = self.even
        stamp = min(now, simulated + self.offset) if even and not free else now
        if even and stamp < self.last < stamp + _WINDOW:
            stamp = self.last
        self.last, self.simulated, self.offset = stamp, simulated, stamp - simulated
        self._watch(now, now - stamp)
        return stamp

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
