# SPDX-License-Identifier: Apache-2.0
"""The reference of a controller at every instant: the latest trajectory, or a held position.

Time is the stamp of the measured state as an integer of nanoseconds, so nothing drifts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.attributes import sealed
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.trajectory.limits import Limits
from arm_dynamics.trajectory.reference import Motion, Reference, Waypoint
from arm_dynamics.trajectory.trajectory import Trajectory, hold
from arm_dynamics.trajectory.waypoints import check_kind, have_torques, quintic


@dataclass(frozen=True)
class Outset:
    """The start of a motion that is being planned.

    Attributes:
        start: Stamp in [ns] at which the waypoints' time is zero.
        begin: Stamp in [ns] of the motion's beginning, not before ``start``.
        reference: The reference then.
    """

    start: int
    begin: int
    reference: Reference

    def through(self, waypoints: Sequence[Waypoint], limits: Limits | None) -> Trajectory:
        """Plan a motion through waypoints, timed in [s] after ``start``; past ones are omitted."""
        return quintic(self.remaining(waypoints), limits)

    @property
    def lag(self) -> float:
        """Delay of its beginning after ``start``, in [s]."""
        return 1e-9 * (self.begin - self.start)

    def remaining(self, waypoints: Sequence[Waypoint]) -> list[Waypoint]:
        """The start and the remaining waypoints, with times in [s] after the beginning."""
        check_kind(waypoints, first=1)  # waypoint 0 is where the arm is
        lag, here = self.lag, self.reference
        points = [replace(w, time=w.time - lag) for w in waypoints if not w.time <= lag]
        if not points:
            raise InvalidInput(
                f"no waypoint lies in the future; allowed: times (time_from_start) after {lag:g} "
                "s, as the arm needs time to get there"
            )
        tau, still = here.tau, np.zeros_like(here.q)
        if have_torques(waypoints, first=1):
            if len(points) < len(waypoints):
                before, after = waypoints[-len(points) - 1], waypoints[-len(points)]
                share = (lag - before.time) / (after.time - before.time)
                first, second = np.asarray(before.tau, float), np.asarray(after.tau, float)
                tau = first + share * (second - first)
            tau = still if tau is None else tau
        elif tau is not None:  # torques at the beginning fade out
            points = [replace(w, tau=still) for w in points]
        return [Waypoint(0.0, here.q, here.v, here.a, tau), *points]


@sealed
class Follower:
    """Returns references, and switches to new trajectories without a jump in q, v or a.

    Example:
        >>> follower = Follower(q, limits)
        >>> follower.follow([Waypoint(2.0, goal)], now=stamp)
        >>> follower.reference(stamp).q
    """

    def __init__(self, q: ArrayLike, limits: Limits | None = None) -> None:
        """Hold position ``q`` in [rad] or [m], (n,); ``limits`` apply to every trajectory."""
        self._limits = limits
        self._start: int = 0
        self._active: Motion = hold(q)
        self._next: tuple[int, Motion] | None = None

    def reference(self, now: int) -> Reference:
        """Return the reference at the stamp ``now`` in [ns]."""
        if self._next is not None and now >= self._next[0]:
            (self._start, self._active), self._next = self._next, None
        return self._active.sample(1e-9 * (now - self._start))

    def remaining(self, now: int) -> float:
        """Time in [s] until all accepted motions are finished, else 0."""
        start, trajectory = self.newest
        return max(0.0, trajectory.duration - 1e-9 * (now - start))

    @property
    def newest(self) -> tuple[int, Motion]:
        """The motion that was accepted last, and the stamp in [ns] at which it begins."""
        return self._next or (self._start, self._active)

    @property
    def active(self) -> tuple[int, Motion]:
        """The stamp in [ns] at which the current motion began, and the motion."""
        return self._start, self._active

    @property
    def next_begin(self) -> int | None:
        """Stamp in [ns] at which the next motion begins; None if there is none."""
        return None if self._next is None else self._next[0]

    def hold(self, q: ArrayLike) -> None:
        """Discard all trajectories and hold position ``q``, shape (n,)."""
        self.begin(hold(q), 0)

    def begin(self, motion: Motion, now: int) -> None:
        """Discard all trajectories and follow a motion from the stamp ``now`` in [ns].

        Unlike with ``take``, it may begin anywhere: the reference jumps there.
        """
        self._start, self._active, self._next = now, motion, None

    def follow(
        self, waypoints: Sequence[Waypoint], now: int, start: int | None = None
    ) -> Trajectory:
        """Follow waypoints, starting from the state of the reference when they begin.

        Args:
            waypoints: Points with times in [s] after ``start``; past ones are omitted.
            now: Current stamp in [ns].
            start: Stamp in [ns] at which time is zero; None for now. Until a later one the current
                motion continues.

        Returns:
            The trajectory that will be followed.

        Raises:
            InvalidInput: If it cannot be followed; the current one continues.
        """
        outset = self.outset(now, start)
        trajectory = outset.through(waypoints, self._limits)
        self.take(outset, trajectory, now)
        return trajectory

    def outset(self, now: int, start: int | None = None, lead: int = 0) -> Outset:
        """The start of a motion that will be ready ``lead`` after ``now``.

        Args:
            now: Current stamp in [ns].
            start: Stamp in [ns] at which time is zero; None for the beginning.
            lead: Time for planning in [ns].
        """
        self.reference(now)
        begin = max(now + lead, start or 0)
        return Outset(begin if start is None else start, begin, self._at(begin))

    def take(self, outset: Outset, motion: Motion, now: int) -> bool:
        """Follow a motion that was planned from an outset of this follower.

        A motion that is ready too late begins late if the reference has been at rest since;
        otherwise it would cause a jump.

        Args:
            outset: Its start.
            motion: The planned motion.
            now: Current stamp in [ns].

        Returns:
            Whether it is followed; otherwise the current one continues.
        """
        self.reference(now)
        begin = max(outset.begin, now)
        there, here = self._at(begin), outset.reference
        if not np.array_equal((there.q, there.v, there.a), (here.q, here.v, here.a)):
            return False
        self._next = (begin, motion)
        self.reference(now)  # it is the active one if it begins now
        return True

    def _at(self, time: int) -> Reference:
        """Reference at a future time, if no other motion is accepted until then."""
        return self._active.sample(1e-9 * (time - self._start))
