# SPDX-License-Identifier: Apache-2.0
"""Simulated time for nodes with ``use_sim_time``."""

from __future__ import annotations

from rclpy.node import Node

from arm_dynamics.ros.common.cdr import NATIVE, time_bytes
from arm_dynamics.ros.common.direct import advertise
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.joint_state import Sink, address
from arm_sim.ros.interfaces import CLOCK

_PERIOD = 1.0  # [s] between looks at who else publishes


class SimClock:
    """Publishes simulated time, and sees when someone else does, too.

    Attributes:
        topic: Where it is published, resolved.
        rivals: How many others publish there.
        sink: What publishes in compiled code.
    """

    def __init__(self, node: Node) -> None:
        """Advertise the clock; rivals are looked for once a second of real time."""
        self._node, self._handle = node, advertise(node, CLOCK).handle
        self._raw = bytearray(NATIVE + time_bytes(0))
        self.sink = Sink(
            raw=address(self._raw), size=len(self._raw), publisher=self._handle.pointer
        )
        self.topic, self.rivals = node.resolve_topic_name(CLOCK.name), 0
        self._timer = steady_timer(node, _PERIOD, self.look)

    def tell(self, stamp: int) -> None:
        """Publish a time in [ns]; for the ticking thread."""
        self._handle.publish_raw(NATIVE + time_bytes(stamp))

    @property
    def complaint(self) -> str:
        """What is wrong, in words; empty if nothing is."""
        if not self.rivals:
            return ""
        return (
            f"{self.rivals + 1} publishers on {self.topic}: time jumps between them; only one "
            "simulation may have publish_clock"
        )

    def look(self) -> None:
        """Count who else publishes, and warn when there is one more."""
        before = self.rivals
        self.rivals = max(self._node.count_publishers(self.topic) - 1, 0)
        if self.rivals > before:
            self._node.get_logger().warning(self.complaint)
