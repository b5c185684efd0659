# SPDX-License-Identifier: Apache-2.0
"""A temporary ROS node of a command: subscribes to topics and publishes on them."""

import time
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.ros.common.caller import TemporaryNode
from arm_dynamics.ros.common.conflicts import publishers
from arm_dynamics.ros.interfaces import Service, Topic
from arm_dynamics.trajectory.reference import Waypoint
from arm_sim.cli.interrupts import postponed

_CHECK_PERIOD = 0.02  # [s] between checks of a condition


class Listener(TemporaryNode):
    """Subscribes to topics and publishes on them; use it in a ``with`` statement."""

    def __init__(self) -> None:
        super().__init__("arm_shell")
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        super().close()

    def subscribe(
        self, topic: Topic, name: str, callback: Callable[[Any], None], raw: bool = False
    ) -> None:
        """Call a function with every message of a topic, by its full name, or with its bytes."""
        self._node.create_subscription(topic.type, name, callback, topic.subscribe, raw=raw)

    def publisher(self, topic: Topic, name: str) -> Publisher:
        """A publisher on a topic, by its full name."""
        return self._node.create_publisher(topic.type, name, topic.publish)

    def client(self, service: Service, node: str) -> Client:
        """A client of a node's service."""
        return self._node.create_client(service.type, service.name.replace("~", node))

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Process messages until a condition holds, for ``timeout`` in [s]; whether it does."""
        end = time.monotonic() + timeout
        while not (met := condition()) and (left := end - time.monotonic()) > 0.0:
            with postponed():
                self._executor.spin_once(timeout_sec=min(_CHECK_PERIOD, left))
        return met

    def spin_for(self, duration: float) -> None:
        """Process messages for a duration in [s]."""
        self.until(lambda: False, duration)

    def publishers(self, topic: str) -> list[str]:
        """Full names of the nodes that publish a topic."""
        return sorted(publishers(self._node, topic).values())


def trajectory_message(names: Iterable[str], waypoints: Iterable[Waypoint]) -> JointTrajectory:
    """Waypoints of joints as a message; quantities that they lack are left empty."""
    message = JointTrajectory(joint_names=list(names))
    for waypoint in waypoints:
        point = JointTrajectoryPoint()
        start = point.time_from_start
        start.sec, start.nanosec = divmod(round(1e9 * waypoint.time), 1_000_000_000)
        for field, values in (
            ("positions", waypoint.q), ("velocities", waypoint.v), ("accelerations", waypoint.a),
            ("effort", waypoint.tau),
        ):  # fmt: skip
            if values is not None:
                setattr(point, field, [float(value) for value in values])
        message.points.append(point)
    return message


def full(name: str) -> str:
    """The full name of a node or topic in the graph."""
    return "/" + name.strip("/")
