# SPDX-License-Identifier: Apache-2.0
"""A sim node whose ticks are triggered by hand."""

from collections import deque
from ctypes import byref
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from harness import Ros
from polled import offered
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import models
from arm_sim.ros import SimNode
from arm_sim.ros.commands.latest import LatestCommand
from arm_sim.ros.node_library import library

NAMES = list(models.dynamics("two_link").joint_names)
TAU = [1.5, -0.5]


def by_hand(ros: Ros, scene: Any = "two_link", **parameters: Any) -> SimNode:
    """The node for a scene, or for one of the robots by name; uncommanded, the arm falls."""
    scene = models.scene(scene) if isinstance(scene, str) else scene
    return ros.add(SimNode, scene, realtime=False, **{"stale_policy": "zero", **parameters})


def next_command(slot: LatestCommand, q: np.ndarray) -> Any:
    """What acts in a tick at q that does not age the command."""
    return slot.command(library().slot_actor(byref(slot)), q)


def commands_to_come(node: SimNode) -> deque[bytes]:
    """Commands that have come since the last tick, in place of the middleware."""
    node.inputs.polled.close()
    return offered(node.inputs, node.engine)


def command(**fields: Any) -> bytes:
    return serialize_message(JointState(**fields))


def ticks(node: SimNode, count: int) -> None:
    for _ in range(count):
        node.tick()


def motion(node: SimNode) -> np.ndarray:
    return np.array([node.simulator.state.q, node.simulator.state.v])


def pushed(frame: str, *values: float) -> WrenchStamped:
    """A push on a frame: three numbers of the force, then three of the torque."""
    message = WrenchStamped()
    message.header.frame_id = frame
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = values
    return message
