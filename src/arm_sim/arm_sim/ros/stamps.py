# SPDX-License-Identifier: Apache-2.0
"""Stamps of what the sim node publishes: simulated time, or time of the node's clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from ctypes import Structure, c_int64
from typing import Any

AUTO, ROS, SIM = "auto", "ros", "sim"
CHOICES = (AUTO, ROS, SIM)
_WINDOW = 1_000_000_000  # [ns] over which the least lag is sought; a stall is made up for sooner
_NEVER = 1 << 62


class SimulatedTime:
    """Stamps that are simulated time: the number of ticks times their length."""

    name = SIM

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time."""
        return simulated

    def release(self) -> None:
        """Nothing to do: simulated time never has to catch up with anything."""


class NodeTime(Structure):
    """Stamps of the node's clock, in steps of the tick while the simulation keeps up with it.

    A thread that ticks by the clock is woken some 50 µs late, now less, now more. Stamps that were
    the time of waking would give a controller a reference that trembles by velocity times that
    time: a Panda that moves by half a radian in two seconds is then 2e-4 to 3e-4 rad off instead
    of 3e-6 (RMS, on a busy machine). So the stamp of a tick is when it is *due*: simulated time
    plus an offset, where

    * no stamp lies in the future: one that would lowers the offset;
    * none falls behind by more than a tick for long: when the least lag of a second is longer, as
      when ticks were dropped, stamps go half as fast again until it is made up for, and jump where
      it is more than a second;
    * stamps do not go backwards, not even when simulated time starts again, unless the clock is
      set back by more than a second.

    Where ticks are not due at even times, or the clock is someone else's simulated time, a stamp
    is what the clock says.

    Args:
        clock: The node's ``rclpy.clock.Clock``.
        tick: Length of a tick in [ns] if ticks are due at even times, else 0.
        system: Time of the system in [ns].

    Attributes:
        tick: As above.
        even: Whether stamps are simulated time plus an offset.
        free: Whether the next stamp is what the clock says.
        simulated: Simulated time of the last stamp in [ns].
        last: The last stamp in [ns].
        offset: Stamp of simulated time zero in [ns].
        least: Least lag since the last look at it in [ns].
        look: When to look at it, in [ns].
        owed: Lag that is still to be made up for in [ns].
    """

    _fields_ = tuple(
        (name, c_int64) for name in "tick even free simulated last offset least look owed".split()
    )
    name = ROS

    def __init__(self, clock: Any, tick: int, system: Callable[[], int] = time.time_ns) -> None:
        super().__init__(tick=tick, simulated=-1, least=_NEVER, free=True)
        self._clock, self._system = clock, system
        self._see()

    def release(self) -> None:
        """Time stood still and goes on: the next stamp is what the clock says."""
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

    def _now(self) -> int:
        # The system's clock is the node's unless use_sim_time is set; to ask rclpy takes 6 µs.
        return int(self._clock.now().nanoseconds) if self._foreign else self._system()

    def _watch(self, now: int, lag: int) -> None:
        if lag < self.least:
            self.least = lag
        if now >= self.look:
            behind = self.least if self.tick < self.least < _NEVER else 0
            jumps = behind > _WINDOW
            self.offset, self.owed = self.offset + behind * jumps, behind * (not jumps)
            self.least, self.look = _NEVER, now + _WINDOW
            self._see()

    def _see(self) -> None:
        """See whose time the clock tells."""
        self._foreign = bool(self._clock.ros_time_is_active)
        self.even = bool(self.tick) and not self._foreign
