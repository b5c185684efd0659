# SPDX-License-Identifier: Apache-2.0
"""Long goals as bytes: their heads are read at once, their points where there is time.

What points mean, which joints, lengths and numbers are allowed, is known where they are converted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.cdr import CdrReader
from arm_dynamics.ros.interfaces import MAX_GOAL_POINTS


class Point(NamedTuple):
    """A JointTrajectoryPoint without its effort.

    Attributes:
        time: ``time_from_start`` in [ns].
        positions: As in the message, any length.
        velocities: Likewise.
        accelerations: Likewise.
    """

    time: int
    positions: Array
    velocities: Array
    accelerations: Array


class Placed(NamedTuple):
    """A PoseStamped without its stamp.

    Attributes:
        frame_id: Its frame, perhaps empty.
        pose: Position and quaternion x y z w, shape (7,).
    """

    frame_id: str
    pose: Array


@dataclass(frozen=True)
class TrajectoryBytes:
    """A serialized JointTrajectory.

    Attributes:
        stamp: Stamp of the header in [ns].
        joint_names: As in the message.
        count: Number of points.
    """

    stamp: int
    joint_names: tuple[str, ...]
    count: int
    _raw: bytes = field(repr=False)
    _begin: int = field(repr=False)

    @classmethod
    def of(cls, raw: bytes, most_names: int) -> TrajectoryBytes:
        """Read the head.

        Args:
            raw: The serialized message.
            most_names: How many joints it may name.

        Raises:
            InvalidInput: If these bytes are no such message, or one beyond limits.
        """
        cdr = CdrReader(raw)
        stamp = cdr.nanoseconds()
        cdr.skip(cdr.count(), 1)  # frame_id, which says nothing
        names = tuple(cdr.text() for _ in range(cdr.count_of("joint names", most_names)))
        count = cdr.count_of("points", MAX_GOAL_POINTS)
        return cls(stamp, names, count, raw, cdr.at)

    def points(self) -> Iterator[Point]:
        """Read one point after another.

        Raises:
            InvalidInput: If the message ends too early.
        """
        cdr = CdrReader(self._raw, self._begin)
        for _ in range(self.count):
            positions, velocities, accelerations = cdr.doubles(), cdr.doubles(), cdr.doubles()
            cdr.doubles()  # effort
            yield Point(cdr.nanoseconds(), positions, velocities, accelerations)


@dataclass(frozen=True)
class PathBytes:
    """A serialized nav_msgs/Path.

    Attributes:
        frame_id: Frame of poses that name none, perhaps empty.
        count: Number of poses.
    """

    frame_id: str
    count: int
    _raw: bytes = field(repr=False)
    _begin: int = field(repr=False)

    @classmethod
    def of(cls, raw: bytes) -> PathBytes:
        """Read the head.

        Raises:
            InvalidInput: If these bytes are no such message, or one beyond limits.
        """
        cdr = CdrReader(raw)
        cdr.nanoseconds()
        frame_id, count = cdr.text(), cdr.count_of("poses", MAX_GOAL_POINTS)
        return cls(frame_id, count, raw, cdr.at)

    def poses(self) -> Iterator[Placed]:
        """Read one pose after another.

        Raises:
            InvalidInput: If the message ends too early.
        """
        cdr = CdrReader(self._raw, self._begin)
        for _ in range(self.count):
            cdr.nanoseconds()
            yield Placed(cdr.text(), cdr.array(7))
