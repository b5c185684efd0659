# SPDX-License-Identifier: Apache-2.0
"""Stamps of what the sim node publishes: simulated time, or time of the node's clock."""

from __future__ import annotations

import time
from collections.abc import Callable
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


class NodeTime:
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
    """

    name = ROS

    def __init__(self, clock: Any, tick: int, system: Callable[[], int] = time.time_ns) -> None:
        self._clock, self._tick, self._system = clock, tick, system
        self._simulated, self._last, self._offset = -1, 0, 0
        self._least, self._look, self._owed = _NEVER, 0, 0
        self._foreign = bool(clock.ros_time_is_active)
        self._free = True

    def release(self) -> None:
        """Time stood still and goes on: the next stamp is what the clock says."""
        self._free = True

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time; time that stands still stays."""
        free, self._free = self._free or simulated < self._simulated, False
        if simulated == self._simulated and not free:
            return self._last
        now = self._now()
        if self._owed:
            more = min(self._owed, (simulated - self._simulated) // 2)
            self._owed, self._offset = self._owed - more, self._offset + more
        even = self._tick and not self._foreign
        stamp = min(now, simulated + self._offset) if even and not free else now
        if even and stamp < self._last < stamp + _WINDOW:
            stamp = self._last
        self._last, self._simulated, self._offset = stamp, simulated, stamp - simulated
        self._watch(now, now - stamp)
        return stamp

    def _now(self) -> int:
        # The system's clock is the node's unless use_sim_time is set; to ask rclpy takes 6 µs.
        return int(self._clock.now().nanoseconds) if self._foreign else self._system()

    def _watch(self, now: int, lag: int) -> None:
        if lag < self._least:
            self._least = lag
        if now >= self._look:
            behind = self._least if self._tick < self._least < _NEVER else 0
            jumps = behind > _WINDOW
            self._offset, self._owed = self._offset + behind * jumps, behind * (not jumps)
            self._least, self._look = _NEVER, now + _WINDOW
            self._foreign = bool(self._clock.ros_time_is_active)
