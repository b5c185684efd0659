# SPDX-License-Identifier: Apache-2.0
"""Poses of messages, checked, in the world of the model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path

from arm_dynamics.arguments import vector
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.model import ArmModel
from arm_dynamics.task_terms import Pose

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


def in_world(message: PoseStamped, model: ArmModel, frame_id: str = "") -> Pose:
    """Read a pose that is given in the world or in a frame that does not move.

    Args:
        message: The pose; its own frame counts before ``frame_id``.
        model: The arm.
        frame_id: Frame for a message that names none; empty for the world.

    Raises:
        InvalidInput: If the frame moves or does not exist, or the pose is none.
    """
    at, turn = message.pose.position, message.pose.orientation
    pose = pose_of((at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w))
    name = message.header.frame_id or frame_id
    if name in ("", "world"):
        return pose
    fixed = {frame.name: frame for frame in model.pin.frames if frame.parentJoint == 0}
    if name not in fixed:
        allowed = known_names(["world", *fixed])
        raise InvalidInput(f"poses in frame '{name}': allowed are frames that stand, {allowed}")
    base = fixed[name].placement
    return Pose(base.rotation @ pose.position + base.translation, base.rotation @ pose.rotation)


def path_of(message: Path, model: ArmModel) -> list[Pose]:
    """Read the poses of a path; their stamps say nothing.

    Raises:
        InvalidInput: As for a pose, with its number.
    """
    poses: list[Any] = []
    for i, stamped in enumerate(message.poses):
        try:
            poses.append(in_world(stamped, model, message.header.frame_id))
        except InvalidInput as error:
            raise InvalidInput(f"pose {i}: {error}") from None
    return poses
