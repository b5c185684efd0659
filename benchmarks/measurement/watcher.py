# SPDX-License-Identifier: Apache-2.0
"""Looks at running nodes from outside: diagnostics, tracking, memory, and a way to do harm."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from arm_msgs.msg import Energy, TrackingState
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.ros.common.executor import make_executor
from arm_sim.cli.interrupts import postponed

_GLANCE = 0.02  # [s]
_SILENCE = 2.5  # [s], five messages of diagnostics
_MEET = 0.5  # [s] that the other side may take to find a publisher
KEEP = 400  # messages of diagnostics
PAGE = 4096


@dataclass
class Status:
    """One part of one node at one time.

    Attributes:
        at: Time of the clock in [s].
        name: Node and part.
        level: 0 good, 1 warning, 2 error.
        message: In words.
        values: By name.
    """

    at: float
    name: str
    level: int
    message: str
    values: dict[str, str]


@dataclass
class Watcher:
    """A node that listens; ``close`` takes it down.

    Attributes:
        domain: ROS domain.
        tracking: Whether to listen to the controller's state and the energy too.
        statuses: Latest diagnostics, oldest first.
        latest: Of every part.
        worst_error: Largest tracking error since it was last set to zero, in [rad].
        energies: How many messages came on ``~/energy``.
    """

    domain: int
    tracking: bool = True
    statuses: list[Status] = field(default_factory=list)
    latest: dict[str, Status] = field(default_factory=dict)
    worst_error: float = 0.0
    energies: int = 0

    def __post_init__(self) -> None:
        """Join the graph."""
        self.context = Context()
        rclpy.init(
            args=[], context=self.context, domain_id=self.domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )  # fmt: skip
        self.node = Node("soak", context=self.context, enable_rosout=False)
        self._executor = make_executor(self.node)
        self._publishers: dict[str, Publisher] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)
        if self.tracking:
            self.node.create_subscription(TrackingState, "controller/state", self._on_state, 10)
            self.node.create_subscription(Energy, "sim/energy", self._on_energy, 10)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.remove_node(self.node)
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def publisher(self, kind: Any, topic: str, qos: Any = 10) -> Publisher:
        """A publisher that has found its subscriber and was found by it, made once."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(kind, topic, qos)
            self.until(self._publishers[topic].get_subscription_count, 5.0)
            self.until(lambda: False, _MEET)
        return self._publishers[topic]

    def has(self, topic: str) -> bool:
        """Whether there is a publisher of a topic."""
        return topic in self._publishers

    def drop(self, topic: str) -> None:
        """Take a publisher down."""
        self.node.destroy_publisher(self._publishers.pop(topic))

    def until(self, done: Callable[[], Any], timeout: float) -> bool:
        """Listen until ``done`` or for ``timeout`` in [s]; whether it is done."""
        end = time.monotonic() + timeout
        while not done():
            if time.monotonic() >= end:
                return False
            with postponed():
                self._executor.spin_once(timeout_sec=_GLANCE)
        return True

    def listen(self, seconds: float) -> None:
        """Only listen."""
        self.until(lambda: False, seconds)

    def said(self, since: float, part: str, words: str) -> Status | None:
        """The first diagnostics of a part since a time that contain some words."""
        for status in self.statuses:
            if status.at >= since and status.name == part and words in status.message:
                return status
        return None

    def troubles(self) -> list[str]:
        """What is not as it should be: errors, silent parts, a loop that is not closed."""
        silent = time.monotonic() - _SILENCE
        found = [f"{s.name} says nothing" for s in self.latest.values() if s.at < silent]
        found += [f"{s.name}: {s.message}" for s in self.latest.values() if s.level == 2]
        for status in self.latest.values():
            if status.values.get("stale", "false") != "false":
                found.append(f"{status.name.partition(':')[0]} gets no commands")
        return found

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for entry in message.status:
            values = {item.key: item.value for item in entry.values}
            status = Status(now, entry.name, ord(entry.level), entry.message, values)
            self.statuses.append(status)
            self.latest[entry.name] = status
        del self.statuses[:-KEEP]

    def _on_state(self, message: TrackingState) -> None:
        self.worst_error = max(self.worst_error, float(np.abs(message.position_error).max()))

    def _on_energy(self, _: Energy) -> None:
        self.energies += 1


def memory(pid: int) -> float:
    """Memory of a process in [MB] that is its own: resident, not shared."""
    resident, shared = map(int, Path(f"/proc/{pid}/statm").read_text().split()[1:3])
    return (resident - shared) * PAGE / 1e6


def processor_time(pid: int) -> float:
    """Processor time that a process has used in [s], from the scheduler's own account."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return 1e-9 * sum(int((task / "schedstat").read_text().split()[0]) for task in tasks)
