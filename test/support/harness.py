# SPDX-License-Identifier: Apache-2.0
"""A ROS of its own for one test."""

import os
import socket
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from arm_dynamics.ros.common.transport import FOLDER, PROFILES, SEGMENTS, as_usual

DOMAINS = 100  # domains above 101 collide with ports that the system gives away
RESERVATIONS = 22_119  # first of the ports that stand for domains in use
_turn = count(os.getpid())


def surroundings(**more: str) -> dict[str, str]:
    """Environment for a process that shall talk as it does for users, on this machine."""
    ours = {name: value for name, value in os.environ.items() if name not in PROFILES}
    return {**ours, **as_usual(), **more}


def segments(pid: int) -> set[str]:
    """What a process has in shared memory."""
    lines = Path(f"/proc/{pid}/maps").read_text().splitlines()
    names = {Path(line.split()[-1]).name for line in lines if f"{FOLDER}/" in line}
    return {name for name in names if name.startswith(SEGMENTS)}


def reserve_domain() -> tuple[int, socket.socket]:
    """Find a domain that no other test here uses; it is ours until the socket closes."""
    for _ in range(DOMAINS):
        domain = 1 + next(_turn) % DOMAINS
        reservation = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            reservation.bind(("127.0.0.1", RESERVATIONS + domain))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as discovery:
                discovery.bind(("", 7410 + 250 * domain))  # nobody else's nodes are there
        except OSError:
            reservation.close()
        else:
            return domain, reservation
    raise RuntimeError("all domains are in use")


class Ros:
    """A context with an executor and a node to talk to the one under test."""

    def __init__(self) -> None:
        self.domain, self._reservation = reserve_domain()
        self.context = Context()
        rclpy.init(args=[], context=self.context, domain_id=self.domain)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._nodes: list[Node] = []
        self.peer = self.add(Node, "test_peer")

    def add(self, make: Callable[..., Any], *args: Any, **parameters: Any) -> Any:
        """Build a node in this context; parameters are given by name."""
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        return self.adopt(make(*args, context=self.context, parameter_overrides=overrides))

    def adopt(self, node: Any) -> Any:
        """Run a node that was built in this context, and take it down in the end."""
        self._nodes.append(node)
        self._executor.add_node(node)
        return node

    def spin_until(self, done: Callable[[], Any], timeout: float = 60.0) -> None:
        """Run callbacks until ``done`` is true."""
        end = time.monotonic() + timeout
        while not done():
            assert time.monotonic() < end, "nothing came in time"
            self.spin_once()

    def spin_once(self, moment: float = 0.02) -> None:
        """Run a callback, if one waits or comes within a moment in [s]."""
        self._executor.spin_once(timeout_sec=moment)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service and return its response."""
        client = self.peer.create_client(kind, name)
        self.spin_until(client.service_is_ready)
        for _ in range(12):  # the reply to a first call may get lost while both match
            future = client.call_async(request)
            try:
                self.spin_until(future.done, timeout=5.0)
            except AssertionError:
                continue
            self.peer.destroy_client(client)
            return future.result()
        raise AssertionError(f"{name} does not answer")

    def publisher(self, kind: Any, name: str, qos: Any = 10) -> Any:
        """A publisher that has found its subscriber."""
        publisher = self.peer.create_publisher(kind, name, qos)
        self.spin_until(publisher.get_subscription_count)
        return publisher

    def listen(self, kind: Any, name: str, qos: Any = 10) -> list[Any]:
        """A list that fills with the messages of a topic whose publisher was found."""
        heard: list[Any] = []
        self.peer.create_subscription(kind, name, heard.append, qos)
        self.spin_until(lambda: self.peer.count_publishers(name))
        return heard

    def close(self) -> None:
        """Take everything down."""
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()
        self.context.try_shutdown()
        self._reservation.close()


def change(node: Node, **values: Any) -> Any:
    """Set parameters of a node, all of them or none; returns its answer."""
    return node.set_parameters_atomically([Parameter(k, value=v) for k, v in values.items()])
