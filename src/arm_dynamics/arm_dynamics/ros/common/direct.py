# SPDX-License-Identifier: Apache-2.0
"""Messages in and out without what lies between them and the middleware.

Who ticks at 1 kHz and wants only the newest message need not be woken for each: a look costs under
a microsecond when there is none and a few when there is one, far less than a callback. Who asks
and has nothing else to do until the answer is there needs no executor, futures or tasks either.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.type_support import check_for_type_support

from arm_dynamics.ros.interfaces import Service, Topic


class Newest:
    """Holds the newest message of a topic as serialized bytes; no executor is needed."""

    def __init__(self, node: Node, topic: Topic) -> None:
        """Subscribe; ``close`` before the node is destroyed."""
        self._type = topic.type
        check_for_type_support(topic.type)
        profile = topic.subscribe.get_c_qos_profile()
        with node.handle:
            self._handle: Any = rclpy_implementation.Subscription(
                node.handle, topic.type, topic.name, profile
            )

    def take(self) -> tuple[bytes, int] | None:
        """Return the message and the system time it came at in [ns], or None if none is new."""
        taken = self._handle.take_message(self._type, True)
        return None if taken is None else (taken[0], taken[1]["received_timestamp"])

    @property
    def pointer(self) -> int:
        """Address of the ``rcl_subscription_t``, valid until ``close``."""
        return int(self._handle.pointer)

    def close(self) -> None:
        """End the subscription."""
        if self._handle is not None:
            self._handle.destroy_when_not_in_use()
            self._handle = None


class Asker:
    """Asks a service; no executor is needed.

    Attributes:
        name: Of the service, as everybody sees it.
    """

    def __init__(self, node: Node, service: Service, name: str) -> None:
        """Get ready to ask; nobody else may spin ``node``."""
        client = node.create_client(service.type, name)
        self.name: str = client.service_name
        self._response, self._handle = service.type.Response, client.handle
        self._waiting: Any = rclpy_implementation.WaitSet(0, 0, 0, 1, 0, 0, node.context.handle)

    def ready(self) -> bool:
        """Whether anybody offers the service."""
        return bool(self._handle.service_server_is_available())

    def ask(self, request: Any) -> int:
        """Send a request; return its number."""
        return int(self._handle.send_request(request))

    def answer(self, asked: Collection[int], timeout: float) -> Any | None:
        """Wait for the answer to one of some requests, by number; others are passed over.

        Returns:
            The first that comes, or None if none does within ``timeout`` in [s].
        """
        end = time.monotonic_ns() + int(1e9 * timeout)
        while (left := end - time.monotonic_ns()) > 0:
            self._waiting.clear_entities()
            self._waiting.add_client(self._handle)
            self._waiting.wait(left)
            info, response = self._handle.take_response(self._response)
            if info is not None and info.request_id.sequence_number in asked:
                return response
        return None


def sender(node: Node, topic: Topic) -> Callable[[bytes], None]:
    """Advertise a topic and return what publishes serialized messages on it.

    No other thread may be using it when the node is destroyed.
    """
    publisher = node.create_publisher(topic.type, topic.name, topic.publish)
    send: Callable[[bytes], None] = publisher.handle.publish_raw
    return send
