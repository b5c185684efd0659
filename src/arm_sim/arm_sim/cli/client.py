# SPDX-License-Identifier: Apache-2.0
"""Calls services of running nodes and says what is wrong when there is no answer."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

import click
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.ros.executor import make_executor
from arm_dynamics.ros.interfaces import Service

_RETRY = 0.4  # [s], doubled each time; a reply is lost when the server has not seen the client yet
_SETTLE = 0.3  # [s] for the server to see the client, where a request must not be repeated
_GLANCE = 0.05  # [s]


class Caller:
    """A short-lived node that asks another one; use it in a ``with`` statement."""

    def __init__(self, node: str, start: str, timeout: float) -> None:
        """Prepare to ask.

        Args:
            node: Name of the node to be asked, with its namespace if it has one.
            start: The command that starts such a node, for messages.
            timeout: How long to wait for it, and for each of its answers, in [s].
        """
        self.node = "/" + node.strip("/")
        self._start, self._timeout = start, timeout

    def __enter__(self) -> Caller:
        """Join the ROS graph."""
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._self = Node(
            f"arm_call_{os.getpid()}", context=self._context, enable_rosout=False,
            start_parameter_services=False,
        )  # fmt: skip
        self._executor = make_executor(self._self)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        _: TracebackType | None,
    ) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._self.destroy_node()
        self._context.try_shutdown()

    def ask(self, service: Service, request: Any, repeatable: bool = True) -> Any:
        """Call a service; a request that brings no answer is repeated.

        Args:
            service: Which one.
            request: The request.
            repeatable: Whether asking twice does no harm.

        Returns:
            The response.

        Raises:
            click.ClickException: If nobody offers the service, or nobody answers.
        """
        name = service.name.replace("~", self.node)
        client = self._self.create_client(service.type, name)
        if not self._until(client.service_is_ready, self._timeout):
            raise click.ClickException(self._nobody(name))
        if not repeatable:
            self._until(lambda: False, _SETTLE)
        end, futures, patience = time.monotonic() + self._timeout, [], _RETRY
        while (left := end - time.monotonic()) > 0.0:
            futures.append(client.call_async(request))
            wait = min(patience, left) if repeatable else left
            if self._until(lambda: any(f.done() for f in futures), wait):
                return next(f.result() for f in futures if f.done())
            patience *= 2.0
        raise click.ClickException(self._silence(name, repeatable))

    def _until(self, condition: Callable[[], bool], timeout: float) -> bool:
        end = time.monotonic() + timeout
        while not (met := condition()) and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=_GLANCE)
        return met

    def _nobody(self, name: str) -> str:
        lines = [f"no node offers {name} (waited {self._timeout:g} s)"]
        others = self._others(name)
        if others:
            lines.append(f"it is offered as {', '.join(others)}: choose that node by --node")
        nodes = [
            f"{'' if space == '/' else space}/{node}"
            for node, space in self._self.get_node_names_and_namespaces()
            if node != self._self.get_name()
        ]
        lines.append(f"nodes seen: {', '.join(sorted(nodes)) or 'none'}")
        lines.append(f"start one in another terminal: {self._start}")
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        lines.append(f"both terminals must have the same ROS_DOMAIN_ID; here it is {domain or 0}")
        return "\n  ".join(lines)

    def _others(self, name: str) -> list[str]:
        wanted = name.rsplit("/", 1)[1]
        offered = self._self.get_service_names_and_types()
        return [
            other for other, _ in offered if other.rsplit("/", 1)[1] == wanted and other != name
        ]

    def _silence(self, name: str, repeatable: bool) -> str:
        return (
            f"{name} is there but gave no answer within {self._timeout:g} s; is its node busy or "
            "stopped? --timeout waits longer"
            + ("" if repeatable else "; the request may have been carried out all the same")
        )
