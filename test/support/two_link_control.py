# SPDX-License-Identifier: Apache-2.0
"""A two-link arm before a controller node: states, trajectories, and what should come of them."""

from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics.control import ComputedTorque, Measured
from arm_dynamics.ros import ControllerNode
from arm_dynamics.trajectory import Reference

DYNAMICS = models.dynamics("two_link")
NAMES = list(DYNAMICS.joint_names)
MS = 1_000_000


def state(
    stamp: int, q: Any = (0.1, -0.2), v: Any = (0.0, 0.0), names: list[str] = NAMES, **more: Any
) -> bytes:
    message = JointState(name=names, position=list(q), velocity=list(v), **more)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return serialize_message(message)


def point(time: float, *positions: float, **more: Any) -> JointTrajectoryPoint:
    made = JointTrajectoryPoint(positions=list(positions), **more)
    made.time_from_start.sec, made.time_from_start.nanosec = divmod(round(time * 10**9), 10**9)
    return made


def trajectory(*points: JointTrajectoryPoint, names: list[str] = NAMES) -> JointTrajectory:
    return JointTrajectory(joint_names=list(names), points=list(points))


def effort(
    node: ControllerNode, stamp: int, q: Any, v: Any = (0.0, 0.0), names: list[str] = NAMES
) -> np.ndarray:
    """What the node commands for a state."""
    command = node.on_joint_states(state(stamp, q, v, names))
    return np.array(deserialize_message(command, JointState).effort)


def wanted(q: Any, v: Any, reference: Reference, bandwidth: Any = 10.0) -> np.ndarray:
    control = ComputedTorque(DYNAMICS, bandwidth)
    return control.torque(Measured(np.array(q), np.array(v)), reference)


def still(*q: float) -> Reference:
    return Reference(np.array(q), np.zeros(2), np.zeros(2))


def reference_of(node: ControllerNode, stamp: int) -> np.ndarray:
    """Position, velocity and acceleration that the node follows, shape (3, 2)."""
    found = node.goals.follower.reference(stamp)
    return np.array([found.q, found.v, found.a])
