# SPDX-License-Identifier: Apache-2.0
"""Goals that the controller node receives.

Long goals stay serialized: their headers are read at once, their points in the background.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import CdrReader
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.ros.common.poses import in_world
from arm_dynamics.ros.interfaces import MAX_GOAL_POINTS
from arm_dynamics.scene.urdf.joint_names import JointNames, NamedJoints
from arm_dynamics.task_space.task_space import Pose
from arm_dynamics.trajectory.reference import Reference, Waypoint


class TrajectoryBytes:
    """A serialized JointTrajectory.

    Attributes:
        stamp: Stamp of the header in [ns].
        joint_names: As in the message.
        count: Number of points.
    """

    def __init__(self, raw: bytes, most_names: int) -> None:
        """Read the head, with up to so many joint names.

        Raises:
            InvalidInput: If these bytes are no such message, or one beyond limits.
        """
        cdr = CdrReader(raw)
        self.stamp = cdr.nanoseconds()
        cdr.skip(cdr.count(), 1)  # frame_id, which is not used
        named = cdr.count_of("joint names", most_names)
        self.joint_names = tuple(cdr.text() for _ in range(named))
        self.count = cdr.count_of("points", MAX_GOAL_POINTS)
        self._raw, self._begin = raw, cdr.at

    def points(self) -> Iterator[tuple[int, Array, Array, Array, Array]]:
        """Time from start in [ns], positions, velocities, accelerations and efforts of each.

        Raises:
            InvalidInput: If the message ends too early.
        """
        cdr = CdrReader(self._raw, self._begin)
        for _ in range(self.count):
            positions, velocities, accelerations, efforts = (cdr.doubles() for _ in range(4))
            yield cdr.nanoseconds(), positions, velocities, accelerations, efforts


class PathBytes:
    """A serialized nav_msgs/Path.

    Attributes:
        frame_id: Frame of poses that name none, perhaps empty.
        count: Number of poses.
    """

    def __init__(self, raw: bytes) -> None:
        """Read the head.

        Raises:
            InvalidInput: If these bytes are no such message, or one beyond limits.
        """
        cdr = CdrReader(raw)
        cdr.nanoseconds()
        self.frame_id, self.count = cdr.text(), cdr.count_of("poses", MAX_GOAL_POINTS)
        self._raw, self._begin = raw, cdr.at

    def poses(self) -> Iterator[tuple[str, Array]]:
        """Frame, perhaps empty, and position and quaternion x y z w, shape (7,), of each.

        Raises:
            InvalidInput: If the message ends too early.
        """
        cdr = CdrReader(self._raw, self._begin)
        for _ in range(self.count):
            cdr.nanoseconds()
            yield cdr.text(), cdr.array(7)


def waypoints(
    message: TrajectoryBytes, model_names: JointNames, here: Reference
) -> list[Waypoint]:
    """Waypoints of a trajectory message, in model order.

    Joints that it does not name keep their reference ``here``; mimic joints agree with their
    leaders.

    Raises:
        InvalidInput: If joints are unknown or repeated, lengths differ, positions are missing, or
            the message is damaged.
    """
    if not message.joint_names:
        raise InvalidInput(f"no joint names; allowed: some of {known_names(model_names)}")
    named, still = NamedJoints(message.joint_names, model_names), np.zeros_like(here.q)

    def at_point(name: str, field: str, i: int, values: Sequence[float]) -> Array | None:
        return named.spread(f"{name} of point {i}", field, values, still) if len(values) else None

    return [
        Waypoint(
            1e-9 * time,
            named.spread(f"positions of point {i}", "position", positions, here.q),
            at_point("velocities", "velocity", i, velocities),
            at_point("accelerations", "acceleration", i, accelerations),
            at_point("effort", "effort", i, efforts),
        )
        for i, (time, positions, velocities, accelerations, efforts) in enumerate(message.points())
    ]


def path_of(message: PathBytes, model: ArmModel) -> list[Pose]:
    """Read the poses of a path; stamps are ignored, a pose's own frame takes precedence.

    Raises:
        InvalidInput: As for a pose, with its number, or if the message is damaged.
    """
    poses: list[Pose] = []
    for i, (frame_id, numbers) in enumerate(message.poses()):
        try:
            poses.append(in_world(numbers, frame_id or message.frame_id, model))
        except InvalidInput as error:
            raise InvalidInput(f"pose {i}: {error}") from None
    return poses
