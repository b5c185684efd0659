# SPDX-License-Identifier: Apache-2.0
"""Poses of messages, checked."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import vector
from arm_dynamics.exceptions import InvalidInput, choices, plain
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.task_space.task_space import Pose

_UNIT = 1e-3  # tolerance of a quaternion's length


def pose_of(numbers: Sequence[float]) -> Pose:
    """Read x y z [m] and a unit quaternion x y z w.

    Raises:
        InvalidInput: If they are anything else.
    """
    seven = vector("pose", np.array(numbers, float), 7)
    length = float(np.linalg.norm(seven[3:]))
    if abs(length - 1.0) > _UNIT:
        raise InvalidInput(
            f"the quaternion x y z w {seven[3:]} has length {length:.4g}; expected 1"
        )
    return Pose(seven[:3], pin.Quaternion(seven[3:] / length).toRotationMatrix())


def in_world(numbers: Sequence[float], frame_id: str, model: ArmModel) -> Pose:
    """Read a pose in the world or in a fixed frame.

    Args:
        numbers: x y z [m] and a quaternion x y z w.
        frame_id: Their frame; empty for the world.
        model: The arm.

    Raises:
        InvalidInput: If the frame moves or does not exist, or the pose is invalid.
    """
    pose = pose_of(numbers)
    if frame_id in ("", "world"):
        return pose
    if not model.has_frame(frame_id) or model.frame(frame_id).parentJoint:
        fixed = [name for name in model.frame_names if model.frame(name).parentJoint == 0]
        allowed = choices(frame_id, fixed)
        raise InvalidInput(
            f"poses in frame '{plain(frame_id, 80)}'; allowed: fixed frames, {allowed}"
        )
    base = model.frame(frame_id).placement
    return Pose(base.rotation @ pose.position + base.translation, base.rotation @ pose.rotation)
