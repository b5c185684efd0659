# SPDX-License-Identifier: Apache-2.0
"""Poses of messages, checked, in the world of the model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from geometry_msgs.msg import PoseStamped

from arm_dynamics.arrays import vector
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.ros.controller.goal_bytes import PathBytes
from arm_dynamics.task_space.task_space import Pose

_UNIT = 1e-3  # how far a quaternion's length may be from one


def pose_of(numbers: Sequence[float]) -> Pose:
    """Read x y z [m] and a quaternion x y z w of length one.

    Raises:
        InvalidInput: If they are anything else.
    """
    seven = vector("pose", np.array(numbers, float), 7)
    length = float(np.linalg.norm(seven[3:]))
    if abs(length - 1.0) > _UNIT:
        raise InvalidInput(
            f"the quaternion x y z w {seven[3:]} has length {length:.4g}; 1 is wanted"
        )
    return Pose(seven[:3], pin.Quaternion(seven[3:] / length).toRotationMatrix())


def in_world(numbers: Sequence[float], frame_id: str, model: ArmModel) -> Pose:
    """Read a pose that is given in the world or in a frame that does not move.

    Args:
        numbers: x y z [m] and a quaternion x y z w.
        frame_id: Their frame; empty for the world.
        model: The arm.

    Raises:
        InvalidInput: If the frame moves or does not exist, or the pose is none.
    """
    pose = pose_of(numbers)
    if frame_id in ("", "world"):
        return pose
    fixed = {frame.name: frame for frame in model.pin.frames if frame.parentJoint == 0}
    if frame_id not in fixed:
        allowed = known_names(["world", *fixed])
        raise InvalidInput(
            f"poses in frame '{frame_id}': allowed are frames that stand, {allowed}"
        )
    base = fixed[frame_id].placement
    return Pose(base.rotation @ pose.position + base.translation, base.rotation @ pose.rotation)


def goal_of(message: PoseStamped, model: ArmModel) -> Pose:
    """Read a pose that stands alone; its stamp says nothing.

    Raises:
        InvalidInput: As ``in_world``.
    """
    at, turn = message.pose.position, message.pose.orientation
    numbers = (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
    return in_world(numbers, message.header.frame_id, model)


def path_of(message: PathBytes, model: ArmModel) -> list[Pose]:
    """Read the poses of a path; their stamps say nothing, their own frames come first.

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
