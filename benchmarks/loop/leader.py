# SPDX-License-Identifier: Apache-2.0
"""A node that sends the arm of a loop around."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics import Dynamics
from arm_sim.cli.demo.processes import free_domain

WARM, SEEN = 8.0, 3.0  # [s], and until the controller has seen the arm
SCENE = "panda"
STEP, REACH = 2.0, 0.25  # [s] from waypoint to waypoint, and how far they are apart in [rad]


@contextmanager
def leader_node() -> Iterator[Node]:
    """A node in a domain that nobody else uses."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=free_domain())
    node = Node("leader", context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        context.try_shutdown()


def lead(node: Node, seconds: float) -> None:
    """Send the arm around."""
    dynamics, rng = Dynamics(SCENE), np.random.default_rng(1)
    points = []
    for k in range(round(seconds / STEP)):
        place = dynamics.model.q0 + REACH * rng.uniform(-1.0, 1.0, dynamics.n)
        point = JointTrajectoryPoint(positions=place.tolist())
        point.time_from_start.sec = round(STEP * (k + 1))
        points.append(point)
    publisher = node.create_publisher(JointTrajectory, "controller/joint_trajectory", 10)
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not (
        publisher.get_subscription_count() and node.count_publishers("joint_states")
    ):
        time.sleep(0.1)
    time.sleep(SEEN)
    publisher.publish(JointTrajectory(joint_names=list(dynamics.joint_names), points=points))
