# SPDX-License-Identifier: Apache-2.0
"""Calls services of running nodes and says what is wrong when there is no answer."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from arm_dynamics.exceptions import NoAnswer
from arm_dynamics.ros.executor import make_executor
from arm_dynamics.ros.interfaces import Service

_RETRY = 0.4  # [s], doubled each time; a reply is lost when the server has not seen the client yet
_SETTLE = 0.3  # [s] for the server to see the client, where a request must not be repeated
_GLANCE = 0.05  # [s]


class Caller:
    """A node that asks other ones. It has a context and an executor of its own."""

    def __init__(self, timeout: float, domain: int | None = None) -> None:
        """Join the ROS graph; ``close`` leaves it.

        Args:
            timeout: How long to wait for a node, and for each of its answers, in [s].
            domain: ROS domain; None for that of the environment.
        """
        self._timeout = timeout
        self._context = Context()
        rclpy.init(
            args=[], context=self._context, domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )  # fmt: skip
        self._node = Node(
            f"arm_call_{os.getpid()}_{id(self) & 0xFFFFFF:x}", context=self._context,
            enable_rosout=False, start_parameter_services=False,
        )  # fmt: skip
        self._executor = make_executor(self._node)
        self._clients: dict[str, Client] = {}
        self._answered: set[str] = set()
        self._offering: dict[str, int] = {}

    def close(self) -> None:
        """Leave the graph; calling it again does no harm."""
        if self._context.ok():
            self._executor.remove_node(self._node)  # before what its callbacks point to is gone
            self._executor.shutdown()
            self._node.destroy_node()
            self._context.try_shutdown()

    def ask(self, node: str, service: Service, request: Any, repeatable: bool = True) -> Any:
        """Call a service; a request that brings no answer is repeated.

        Args:
            node: Name of the node to be asked, with its namespace if it has one.
            service: Which one.
            request: The request.
            repeatable: Whether asking twice does no harm.

        Returns:
            The response.

        Raises:
            NoAnswer: If nobody offers the service, or nobody answers.
        """
        name = service.name.replace("~", "/" + node.strip("/"))
        client = self._client(service, name)
        if not self._until(client.service_is_ready, self._timeout):
            self._answered.discard(name)
            raise NoAnswer(self._nobody(name))
        met = name in self._answered
        if not (met or repeatable):
            self._until(lambda: False, _SETTLE)
        # One that has answered before may have been started anew since; but give it time to work.
        patience = self._timeout / 3.0 if met else _RETRY
        response = self._response(client, request, patience if repeatable else None)
        if response is None:
            self._answered.discard(name)
            raise NoAnswer(self._silence(name, repeatable))
        self._answered.add(name)
        return response

    def _client(self, service: Service, name: str) -> Client:
        if name not in self._clients:
            self._clients[name] = self._node.create_client(service.type, name)
        return self._clients[name]

    def _response(self, client: Client, request: Any, patience: float | None) -> Any | None:
        """What is answered; asked again after ``patience`` in [s], unless that is None."""
        end, futures = time.monotonic() + self._timeout, list[Future]()
        answered = partial(_any_done, futures)
        while (left := end - time.monotonic()) > 0.0 and not answered():
            futures.append(client.call_async(request))
            if patience is None:
                self._until(answered, left)
                break
            changed = self._changed(client.service_name, answered, min(patience, left))
            # Later each time, but three times at least.
            longer = min(2.0 * patience, max(patience, self._timeout / 3.0))
            patience = _RETRY if changed else longer
        done = next((f for f in futures if f.done()), None)
        for future in futures:
            if future is not done:
                client.remove_pending_request(future)
        return None if done is None else done.result()

    def _changed(self, service: str, answered: Callable[[], bool], patience: float) -> bool:
        """Wait for an answer; say whether who offers the service has changed before it came.

        One that was killed still counts as there for up to 20 s: what was asked of it is lost.
        """
        count = partial(self._node.count_services, service)
        if service not in self._offering:
            self._offering[service] = count()
        before = self._offering[service]
        if self._until(answered, min(_GLANCE, patience)):  # most answers; the rest takes time
            return False
        self._until(lambda: answered() or count() != before, patience - _GLANCE)
        self._offering[service] = count()
        return self._offering[service] != before

    def _until(self, condition: Callable[[], bool], timeout: float) -> bool:
        end = time.monotonic() + timeout
        while not (met := condition()) and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=_GLANCE)
        return met

    def _nobody(self, name: str) -> str:
        lines = [f"no node offers {name} (waited {self._timeout:g} s)"]
        wanted, offered = name.rsplit("/", 1)[1], self._node.get_service_names_and_types()
        others = [o for o, _ in offered if o.rsplit("/", 1)[1] == wanted and o != name]
        if others:
            lines.append(f"it is offered as {', '.join(others)}")
        nodes = [
            f"{'' if space == '/' else space}/{node}"
            for node, space in self._node.get_node_names_and_namespaces()
            if node != self._node.get_name()
        ]
        lines.append(f"nodes seen: {', '.join(sorted(nodes)) or 'none'}")
        domain = self._context.get_domain_id()
        lines.append(f"both sides must have the same ROS_DOMAIN_ID; here it is {domain}")
        return "\n  ".join(lines)

    def _silence(self, name: str, repeatable: bool) -> str:
        return (
            f"{name} is there but gave no answer within {self._timeout:g} s; is its node busy or "
            "stopped?"
            + ("" if repeatable else " The request may have been carried out all the same")
        )


def _any_done(futures: list[Future]) -> bool:
    return any(future.done() for future in futures)
