# SPDX-License-Identifier: Apache-2.0
"""Calls to services of running nodes, with a diagnosis if there is no answer."""

import os
import time
from collections.abc import Collection
from functools import partial
from typing import Any, Self

import rclpy
from rclpy.context import Context
from rclpy.exceptions import NameValidationException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_namespace import validate_namespace

from arm_dynamics.exceptions import InvalidInput, NoAnswer
from arm_dynamics.ros.common.threads.scheduling import arrange_middleware_threads
from arm_dynamics.ros.interfaces import Service

_RETRY = 0.4  # [s], doubled each time; a reply is lost when the server has not seen the client yet
_SETTLE = 0.3  # [s] for the server to see the client, where a request must not be repeated
_POLL = 0.01  # [s] between checks for a server
_POLL_COUNT = 0.05  # [s] between checks of the number of servers, while waiting for an answer


class Silence(NoAnswer):
    """A service that exists did not answer in time."""


class PolledClient:
    """A client of a service that needs no executor; its node must not be spun elsewhere.

    Attributes:
        name: Full name of the service.
        has_answered: Whether the last request was answered.
        server_count: Number of servers at the last look; None before the first.
    """

    def __init__(self, node: Node, service: Service, name: str) -> None:
        client = node.create_client(service.type, name)
        self.name: str = client.service_name
        self.has_answered, self.server_count = False, None
        self._response, self._handle = service.type.Response, client.handle
        self._waiting: Any = rclpy_implementation.WaitSet(0, 0, 0, 1, 0, 0, node.context.handle)

    def is_ready(self) -> bool:
        """Whether the service has a server."""
        return bool(self._handle.service_server_is_available())

    def send(self, request: Any) -> int:
        """Send a request; return its number."""
        return int(self._handle.send_request(request))

    def receive(self, requests: Collection[int], timeout: float) -> Any | None:
        """The first answer to any of the requests of these numbers within ``timeout`` in [s]."""
        end = time.monotonic_ns() + int(1e9 * timeout)
        while (left := end - time.monotonic_ns()) > 0:
            self._waiting.clear_entities()
            self._waiting.add_client(self._handle)
            self._waiting.wait(left)
            info, response = self._handle.take_response(self._response)
            if info is not None and info.request_id.sequence_number in requests:
                return response
        return None


class TemporaryNode:
    """A node with a context of its own, which joins a domain of the ROS graph for a while.

    Its name begins with ``name``; the domain None is that of the environment.
    """

    def __init__(self, name: str, domain: int | None = None) -> None:
        self._context = Context()
        rclpy.init(
            args=[], context=self._context, domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )  # fmt: skip
        self._node = Node(
            f"{name}_{os.getpid()}_{id(self) & 0xFFFFFF:x}", context=self._context,
            enable_rosout=False, start_parameter_services=False,
        )  # fmt: skip
        arrange_middleware_threads()

    def __enter__(self) -> Self:
        """Use it in a ``with`` statement."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the graph."""
        self.close()

    def close(self) -> None:
        """Leave the graph; may be called repeatedly."""
        if self._context.ok():
            self._node.destroy_node()
            self._context.try_shutdown()

    def nodes(self) -> list[str]:
        """Full names of the other nodes."""
        nodes, own_name = self._node.get_node_names_and_namespaces(), self._node.get_name()
        return sorted(f"{space.rstrip('/')}/{name}" for name, space in nodes if name != own_name)

    def where(self, node: str | None = None) -> str:
        """The visible nodes, and what to check if none, or not this one, is among them."""
        visible = [name for name in self.nodes() if "/arm_shell_" not in name]
        text = f"nodes seen: {', '.join(visible) or 'none'}"
        if node in visible:
            return f"{text}\n  {node} may still be starting"
        if node is None and visible:
            return text
        domain = self._context.get_domain_id()
        return f"{text}\n  both sides must have the same ROS_DOMAIN_ID; here it is {domain}"


class Caller(TemporaryNode):
    """A node that calls services; it waits ``timeout`` in [s] for a node, and for each answer."""

    def __init__(self, timeout: float, domain: int | None = None) -> None:
        super().__init__("arm_call", domain)
        self._timeout = timeout
        self._clients: dict[tuple[str, str], PolledClient] = {}

    def close(self) -> None:
        """Leave the graph; may be called repeatedly."""
        self._clients.clear()
        super().close()

    def ask(self, node: str, service: Service, request: Any, repeatable: bool = True) -> Any:
        """The response of a node, given by its name with its namespace, if it has one.

        A request without an answer is repeated if it is ``repeatable``.

        Raises:
            InvalidInput: If no node can have that name.
            NoAnswer: If no node offers the service, or none answers.
        """
        if (client := self._clients.get((node, service.name))) is None:
            name = service.name.replace("~", _full_name(node))
            client = self._clients[node, service.name] = PolledClient(self._node, service, name)
        if not (client.has_answered and repeatable):  # a check takes 10 µs
            self._await_server(client, repeatable)
        # A server that has answered before may have been restarted, but it needs time to work.
        patience = self._timeout / 3.0 if client.has_answered else _RETRY
        response = self._response(client, request, patience if repeatable else None)
        client.has_answered = response is not None
        if response is None:
            raise self._failure(client, repeatable)
        return response

    def _await_server(self, client: PolledClient, repeatable: bool) -> None:
        """Wait for the service, and until its server sees a client that may ask only once."""
        end = time.monotonic() + self._timeout
        while not client.is_ready():
            if time.monotonic() >= end:
                client.has_answered = False
                raise NoAnswer(self._not_offered(client.name))
            time.sleep(_POLL)
        if not (client.has_answered or repeatable):
            time.sleep(_SETTLE)

    def _response(self, client: PolledClient, request: Any, patience: float | None) -> Any | None:
        """The response; the request is repeated after ``patience`` in [s], unless that is None."""
        end, requests = time.monotonic() + self._timeout, set[int]()
        count_servers = partial(self._node.count_services, client.name)
        while (left := end - time.monotonic()) > 0.0:
            requests.add(client.send(request))
            if patience is None:
                return client.receive(requests, left)
            if client.server_count is None:
                client.server_count = count_servers()
            # Requests to a server that was killed are lost, and it counts for up to 20 s: if the
            # number of servers changes, the request is repeated at once.
            count, due = client.server_count, time.monotonic() + min(patience, left)
            while client.server_count == count and (wait := due - time.monotonic()) > 0.0:
                response = client.receive(requests, min(_POLL_COUNT, wait))
                if response is not None:
                    return response
                client.server_count = count_servers()
            # Wait longer each time, but repeat at least three times.
            longer = min(2.0 * patience, max(patience, self._timeout / 3.0))
            patience = longer if client.server_count == count else _RETRY
        return None

    def _failure(self, client: PolledClient, repeatable: bool) -> NoAnswer:
        """The error of a request without an answer: no server, or one that is silent."""
        if not client.is_ready():
            return NoAnswer(self._not_offered(client.name))
        doubt = "" if repeatable else " The request may have been carried out nevertheless"
        return Silence(
            f"{client.name} exists but did not answer within {self._timeout:g} s; is its "
            f"node busy or stopped?{doubt}"
        )

    def _not_offered(self, name: str) -> str:
        """A service without a server, and where one of its name is offered."""
        lines = [f"no node offers {name} (waited {self._timeout:g} s)"]
        service, offered = name.rsplit("/", 1)[1], self._node.get_service_names_and_types()
        elsewhere = [o for o, _ in offered if o.rsplit("/", 1)[1] == service and o != name]
        if elsewhere:
            lines.append(f"it is offered as {', '.join(elsewhere)}")
        return "\n  ".join([*lines, self.where(name.rsplit("/", 1)[0])])


def _full_name(node: str) -> str:
    """A node's name with its namespace, which begins with a slash."""
    name = "/" + node.strip("/")
    try:
        if name != "/":
            validate_namespace(name)  # of the same form, without the ~ and {} of topics
            return name
    except NameValidationException:
        pass
    raise InvalidInput(
        f"node {node!r}; expected a name such as 'sim' or 'left/sim', of letters, digits and _, "
        "no part of which begins with a digit"
    )
