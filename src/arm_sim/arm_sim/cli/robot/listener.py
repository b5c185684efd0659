# SPDX-License-Identifier: Apache-2.0
"""A temporary ROS node of a command: subscribes to topics and publishes on them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any, Self

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.ros.common.diagnostics import publishers
from arm_dynamics.ros.common.privileges import arrange_middleware_threads
from arm_dynamics.ros.interfaces import Topic
from arm_sim.cli.interrupts import postponed

_GLANCE = 0.02  # [s] between checks of a condition


class Listener:
    """A node with a context of its own; use it in a ``with`` statement."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(
            f"arm_shell_{os.getpid()}", context=self._context, enable_rosout=False,
            start_parameter_services=False,
        )  # fmt: skip
        arrange_middleware_threads()
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def hear(
        self, topic: Topic, name: str, heard: Callable[[Any], None], raw: bool = False
    ) -> None:
        """Call a function with every message of a topic, by its full name, or with its bytes."""
        self._node.create_subscription(topic.type, name, heard, topic.subscribe, raw=raw)

    def publisher(self, topic: Topic, name: str) -> Publisher:
        """A publisher on a topic, by its full name."""
        return self._node.create_publisher(topic.type, name, topic.publish)

    def until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Process messages until a condition holds, for ``timeout`` in [s]; whether it does."""
        end = time.monotonic() + timeout
        while not (met := condition()) and (left := end - time.monotonic()) > 0.0:
            with postponed():
                self._executor.spin_once(timeout_sec=min(_GLANCE, left))
        return met

    def publishers(self, topic: str) -> list[str]:
        """Full names of the nodes that publish a topic."""
        return sorted(publishers(self._node, topic).values())

    def nodes(self) -> list[str]:
        """Full names of the other nodes."""
        found = self._node.get_node_names_and_namespaces()
        mine = self._node.get_name()
        return sorted(f"{space.rstrip('/')}/{name}" for name, space in found if name != mine)

    def where(self) -> str:
        """The visible nodes, for messages."""
        domain = self._context.get_domain_id()
        seen = ", ".join(n for n in self.nodes() if "/arm_shell_" not in n) or "none"
        rule = f"both sides must have the same ROS_DOMAIN_ID; here it is {domain}"
        return f"nodes seen: {seen}" if seen != "none" else f"nodes seen: none\n  {rule}"


def full(name: str) -> str:
    """The full name of a node or topic in the graph."""
    return "/" + name.strip("/")
