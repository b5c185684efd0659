# SPDX-License-Identifier: Apache-2.0
"""The reference a controller follows at every instant: the latest trajectory, or standing still.

Time is the stamp of the measured state as an integer of nanoseconds, so nothing drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.motion import Limits, Reference, Trajectory, Waypoint, hold
from arm_dynamics.trajectory import quintic


class Follower:
    """Gives the reference at a time and takes new trajectories without a jump in q, v or a.

    Example:
        >>> follower = Follower(limits, q)
        >>> follower.follow([Waypoint(2.0, goal)], now=stamp)
        >>> follower.reference(stamp).q
    """

    def __init__(self, q: ArrayLike, limits: Limits | None = None) -> None:
        """Stand still at ``q`` in [rad], shape (n,); ``limits`` hold for every trajectory."""
        self._limits = limits
        self._start, self._active = 0, hold(q)
        self._next: tuple[int, Trajectory] | None = None

    def reference(self, now: int) -> Reference:
        """Return the reference at the stamp ``now`` in [ns]."""
        if self._next is not None and now >= self._next[0]:
            (self._start, self._active), self._next = self._next, None
        return self._active.sample(1e-9 * (now - self._start))

    def remaining(self, now: int) -> float:
        """Time in [s] until everything accepted so far has been followed, else 0."""
        start, trajectory = self._next or (self._start, self._active)
        return max(0.0, trajectory.duration - 1e-9 * (now - start))

    def hold(self, q: ArrayLike) -> None:
        """Forget every trajectory and stand still at ``q``, shape (n,)."""
        self._start, self._active, self._next = 0, hold(q), None

    def follow(
        self, waypoints: Sequence[Waypoint], now: int, start: int | None = None
    ) -> Trajectory:
        """Follow waypoints, from wherever the reference is and however it moves when they begin.

        Args:
            waypoints: Points with times in [s] after ``start``; those that are over are left out.
            now: Stamp of the present in [ns].
            start: Stamp in [ns] that times count from: the present when None; until a later one
                the motion under way goes on.

        Returns:
            The trajectory that will be followed.

        Raises:
            InvalidInput: If it cannot be followed; the one under way goes on.
        """
        start = now if start is None else start
        begin = max(start, now)
        late = 1e-9 * (begin - start)
        ahead = [replace(w, time=w.time - late) for w in waypoints if not w.time <= late]
        if not ahead:
            raise InvalidInput(
                f"none of {len(waypoints)} waypoints lies in the future; allowed are times after "
                f"{late:g} s, as the arm needs time to get there"
            )
        here = self.reference(begin) if begin == now else self._sample_later(begin)
        trajectory = quintic([Waypoint(0.0, here.q, here.v, here.a), *ahead], self._limits)
        if begin == now:
            self._start, self._active, self._next = begin, trajectory, None
        else:
            self._next = (begin, trajectory)
        return trajectory

    def _sample_later(self, time: int) -> Reference:
        return self._active.sample(1e-9 * (time - self._start))
