# SPDX-License-Identifier: Apache-2.0
"""Simulated time for nodes with ``use_sim_time``."""

from rclpy.node import Node

from arm_dynamics.cdr import NATIVE, time_bytes
from arm_dynamics.codegen.addresses import address
from arm_dynamics.ros.common.conflicts import Alarm
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.joint_state.sink import Sink
from arm_sim.ros.interfaces import CLOCK

_PERIOD = 1.0  # [s] between checks for other publishers


class SimClock:
    """Publishes simulated time, and detects other publishers of it.

    Attributes:
        topic: Its topic, resolved.
        alarm: On while there are other publishers.
        sink: Publishes it in compiled code.
    """

    def __init__(self, node: Node) -> None:
        """Advertise the clock; other publishers are checked for once a second of real time."""
        self._node, self._handle = node, advertise(node, CLOCK).handle
        self._raw = raw = bytearray(NATIVE + time_bytes(0))
        self.sink = Sink(raw=address(raw), size=len(raw), publisher=self._handle.pointer)
        self.topic, self.alarm = node.resolve_topic_name(CLOCK.name), Alarm(node)
        self._timer = steady_timer(node, _PERIOD, self.check_conflict)

    def check_conflict(self) -> None:
        """Count publishers."""
        count = self._node.count_publishers(self.topic)
        message = (
            f"{count} publishers on {self.topic}: time jumps between them; only one "
            "simulation may have publish_clock"
        )
        self.alarm.set(message if count > 1 else "")
