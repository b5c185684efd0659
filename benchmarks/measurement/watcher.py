# SPDX-License-Identifier: Apache-2.0
"""Looks at running nodes from outside: their diagnostics and their processor time."""

import time
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from arm_dynamics.ros.common.executor import make_executor
from arm_sim.cli.interrupts import postponed

_GLANCE = 0.02  # [s]


class Watcher:
    """A node that listens to diagnostics; ``close`` takes it down.

    Attributes:
        latest: Values of every part of a node, by name.
        warned: Names of parts that have warned or reported an error.
    """

    def __init__(self, domain: int) -> None:
        self.latest: dict[str, dict[str, str]] = {}
        self.warned = set[str]()
        self._context = Context()
        rclpy.init(
            args=[], context=self._context, domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )  # fmt: skip
        self._node = Node("watcher", context=self._context, enable_rosout=False)
        self._executor = make_executor(self._node)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)

    def close(self) -> None:
        self._executor.remove_node(self._node)
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def listen(self, seconds: float) -> None:
        """Listen for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with postponed():
                self._executor.spin_once(timeout_sec=_GLANCE)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        status: DiagnosticStatus
        for status in message.status:
            self.latest[status.name] = {item.key: item.value for item in status.values}
            if status.level != DiagnosticStatus.OK:
                self.warned.add(status.name)


def processor_time(pid: int) -> dict[str, float]:
    """Processor time of a process in [s] by thread, from the scheduler's own account."""
    return {
        task.name: 1e-9 * int((task / "schedstat").read_text().split()[0])
        for task in Path(f"/proc/{pid}/task").iterdir()
    }
