# SPDX-License-Identifier: Apache-2.0
"""Checked conversion between messages and bytes, arrays: times, numbers, poses."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pinocchio as pin
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message

from arm_dynamics.arrays import vector
from arm_dynamics.cdr import GIGA
from arm_dynamics.exceptions import ArmError, InvalidInput, choices, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.task_space.task_space import Pose

_UNIT = 1e-3  # tolerance of a quaternion's length


def as_bytes(message: Any) -> bytes:
    """Serialize a message, unless it is serialized already."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


def to_time(stamp: int) -> Time:
    """Convert a stamp in [ns] to a Time message."""
    seconds, nanoseconds = divmod(stamp, GIGA)
    return Time(sec=seconds, nanosec=nanoseconds)


def to_nanoseconds(message: Any) -> int:
    """Convert a Time or Duration message to [ns]."""
    return int(message.sec) * GIGA + int(message.nanosec)


def to_array(values: Any) -> array[float]:
    """Convert numbers to the type of message fields, row after row."""
    return array("d", np.ascontiguousarray(values, float).tobytes())


@contextmanager
def answering(response: Any, log: Throttled) -> Iterator[None]:
    """Answer a service with success or with an error message; no request ends the node."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # refused by finite_answer
            yield
    except ArmError as error:
        response.success, response.message = False, plain(error)
    except Exception as error:
        log.error(f"a service call failed unexpectedly: {plain(repr(error))}")
        response.success, response.message = False, plain(f"unexpected failure: {error!r}")
    else:
        response.success = True


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
