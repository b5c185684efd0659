# SPDX-License-Identifier: Apache-2.0
"""A Panda's hand that is sent somewhere: messages, and what a controller makes of them."""

import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from trajectory_msgs.msg import JointTrajectory
from two_link_control import effort, point, trajectory

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.task_space import TaskSpace, quaternions

FRAME = "panda_hand_tcp"
HAND = TaskSpace(models.dynamics("panda"), FRAME)
HOME = models.dynamics("panda").model.q0
HERE = HAND.pose(HOME)
NAMES = list(models.dynamics("panda").joint_names)


def see(node: ControllerNode, stamp: int, q: Any = HOME, v: Any = (0.0,) * 7) -> np.ndarray:
    """Show the node a state; returns what it commands."""
    return effort(node, stamp, q, v, names=NAMES)


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
    shares = np.arange(1, points + 1) / points
    places = HOME + 0.2 * (shares**3 * (10 - 15 * shares + 6 * shares**2))[:, None]
    way = zip(late + seconds * shares, places.tolist(), strict=True)
    return trajectory(*(point(at, *place) for at, place in way), names=NAMES)
