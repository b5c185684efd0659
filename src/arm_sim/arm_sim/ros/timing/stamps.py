# SPDX-License-Identifier: Apache-2.0
"""Stamps of the sim node's messages: simulated time, or time of the node's clock."""

import time
from collections.abc import Callable
from ctypes import Structure, addressof, byref, c_int64
from typing import Any

from arm_sim.ros.node_library import TIMING, library

AUTO, ROS, SIM = "auto", "ros", "sim"
CHOICES = (AUTO, ROS, SIM)


class SimulatedTime:
    """Stamps that are simulated time: the number of ticks times their length."""

    name = SIM

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time."""
        return simulated

    near = at

    def update_source(self) -> None:
        """Nothing to do: there is no clock."""

    def release(self) -> None:
        """Nothing to do: simulated time never lags."""

    def follow(self, deadline: c_int64) -> None:
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
    the time of the clock. It is ``times_t`` of timing.h, where the fields are explained.

    Args:
        clock: The node's ``rclpy.clock.Clock``.
        tick: Length of a tick in [ns] if ticks are due at even times, else 0.
        system: Time of the system in [ns].
        steady: Time of the monotonic clock in [ns].
    """

    _fields_ = TIMING.fields("times_t")
    name = ROS

    def __init__(
        self, clock: Any, tick: int, system: Callable[[], int] = time.time_ns,
        steady: Callable[[], int] = time.monotonic_ns,
    ) -> None:  # fmt: skip
        super().__init__(tick=tick, simulated=-1, free=True)
        self._clock, self._system, self._steady = clock, system, steady
        self.follow(c_int64())
        self.update_source()

    def follow(self, deadline: c_int64) -> None:
        """Read there from now on when the current tick was due, in [ns] of the steady clock.

        Zero: this is unknown, and ticks are not late.
        """
        self._deadline, self.due = deadline, addressof(deadline)  # kept alive, for C

    def release(self) -> None:
        """After time stood still, the next stamp is that of the clock."""
        self.free = True

    def at(self, simulated: int) -> int:
        """The stamp of a state, in [ns], from its simulated time; time that stands still stays."""
        next_check, now = self.next_check, self.now
        stamp = library().times_stamp_at(byref(self), simulated, now, self._steady())
        if self.next_check != next_check:  # once a second
            self.update_source()
        return int(stamp)

    def near(self, simulated: int) -> int:
        """The stamp of a simulated time close to that of the last stamp; for any thread."""
        return int(simulated + self.offset)

    @property
    def now(self) -> int:
        """Time of the node's clock in [ns]."""
        # The node's clock is the system's unless use_sim_time is set; asking rclpy takes 6 µs.
        return int(self._clock.now().nanoseconds) if self.foreign else self._system()

    def update_source(self) -> None:
        """Determine the source of the node's clock."""
        foreign = self._clock.ros_time_is_active
        self.foreign = self._clock.handle.pointer if foreign else None
        self.even = bool(self.tick) and not foreign
