# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of topics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from arm_dynamics.exceptions import plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.interfaces import Topic


def advertise(node: Node, topic: Topic) -> Any:
    """Create a publisher; its ``handle.publish_raw`` publishes serialized messages.

    No other thread may be using it when the node is destroyed.
    """
    return node.create_publisher(topic.type, topic.name, topic.publish)


def guarded(node: Node, callback: Callable[[Any], Any]) -> Callable[[Any], None]:
    """A callback for messages whose exceptions are logged and do not end the node."""
    log = Throttled(node.get_logger())

    def guarded_callback(message: Any) -> None:
        try:
            callback(message)
        except Exception as error:
            log.error(plain(f"a message was ignored after an unexpected failure: {error!r}"))

    return guarded_callback


def subscribe(node: Node, topic: Topic, callback: Callable[[Any], Any], raw: bool = False) -> Any:
    """Subscribe by a callback that is ``guarded``."""
    safe = guarded(node, callback)
    return node.create_subscription(topic.type, topic.name, safe, topic.subscribe, raw=raw)
