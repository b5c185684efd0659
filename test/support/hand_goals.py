# SPDX-License-Identifier: Apache-2.0
"""A Panda's hand that is sent somewhere: messages, and what a controller makes of them."""

import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from harness import Ros
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.task_space import TaskSpace, quaternions

FRAME = "panda_hand_tcp"
HAND = TaskSpace(models.dynamics("panda"), FRAME)
HOME = models.dynamics("panda").model.q0
HERE = HAND.pose(HOME)
NAMES = list(models.dynamics("panda").joint_names)
MS = 1_000_000


def state(stamp: int, q: Any = HOME, v: Any = (0.0,) * 7) -> bytes:
    message = JointState(name=NAMES, position=list(q), velocity=list(v))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return serialize_message(message)


def see(node: ControllerNode, stamp: int, *where: Any) -> np.ndarray:
    """Show the node a state; returns what it commands."""
    command = node.on_joint_states(state(stamp, *where))
    return np.array(deserialize_message(command, JointState).effort)


def controller_at_home(ros: Ros) -> ControllerNode:
    """Controls a Panda that has been seen at home."""
    made = ros.add(ControllerNode, models.scene("panda"), task_frame=FRAME)
    see(made, 0)
    return made


def pose(step: Any = (0.0, 0.0, 0.0), frame_id: str = "") -> PoseStamped:
    """Where the hand is at home, shifted."""
    message = PoseStamped()
    message.header.frame_id = frame_id
    at, turn = message.pose.position, message.pose.orientation
    at.x, at.y, at.z = (HERE.position + step).tolist()
    turn.x, turn.y, turn.z, turn.w = quaternions(HERE.rotation).tolist()
    return message


def path(*steps: Any, frame_id: str = "") -> Path:
    message = Path(poses=[pose(step) for step in steps])
    message.header.frame_id = frame_id
    return message


def planned(node: ControllerNode, stamp: int) -> None:
    """Send states of one instant until planning is finished."""
    end = time.monotonic() + 20.0
    while node.goals.planner.busy and time.monotonic() < end:
        time.sleep(2e-3)
        see(node, stamp)
    assert not node.goals.planner.busy


def hand(node: ControllerNode, stamp: int) -> np.ndarray:
    return HAND.pose(node.goals.follower.reference(stamp).q).position - HERE.position


def long_trajectory(points: int, seconds: float, late: float = 0.0) -> JointTrajectory:
    message = JointTrajectory(joint_names=NAMES)
    for k in range(1, points + 1):
        s = k / points
        point = JointTrajectoryPoint(
            positions=(HOME + 0.2 * s**3 * (10 - 15 * s + 6 * s**2)).tolist()
        )
        at = round(1e9 * (late + seconds * s))
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(at, 10**9)
        message.points.append(point)
    return message
