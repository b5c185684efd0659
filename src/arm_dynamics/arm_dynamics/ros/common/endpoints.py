# SPDX-License-Identifier: Apache-2.0
"""Publishers, subscriptions and services, none of whose messages ends their node."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from rclpy.node import Node

from arm_dynamics.exceptions import ArmError, plain
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
