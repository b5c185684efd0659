# SPDX-License-Identifier: Apache-2.0
"""A sim node whose ticks are triggered by hand."""

from collections.abc import Callable
from ctypes import byref
from typing import Any

import numpy as np
from harness import Ros
from polled import offered
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

import models
from arm_dynamics.ros import ControllerNode
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
    return slot.command(library().slot_acting(byref(slot)), q)


class Waiting:
    """Commands that have come since the last tick, in place of the middleware."""

    def __init__(self, node: SimNode) -> None:
        node.inputs.polled.close()
        self.messages = offered(node.inputs, node.engine)


def command(**fields: Any) -> bytes:
    return serialize_message(JointState(**fields))


def ticks(node: SimNode, count: int) -> None:
    for _ in range(count):
        node.tick()


def motion(node: SimNode) -> np.ndarray:
    return np.array([node.simulator.state.q, node.simulator.state.v])


def follow(
    sim: SimNode, controller: ControllerNode, goal: JointTrajectory, count: int,
    answer: Callable[[], bytes | None] | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Errors and positions at each tick, each state answered within its tick."""
    answer = answer or (lambda: controller.on_joint_states(state_bytes(sim)))
    errors, positions = [], []
    for k in range(count):
        sim.inputs.on_joint_commands(answer())
        if k == 0:
            controller.on_joint_trajectory(goal)
        sim.tick()
        reference = controller.goals.follower.reference(round(sim.simulator.state.time * 1e9))
        errors.append(reference.q - sim.simulator.state.q)
        positions.append(sim.simulator.state.q)
    return np.array(errors), np.array(positions)


def state_bytes(sim: SimNode) -> bytes:
    state, message = sim.simulator.state, JointState(name=list(sim.simulator.joint_names))
    message.position, message.velocity = state.q.tolist(), state.v.tolist()
    stamp = round(state.time * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return serialize_message(message)
