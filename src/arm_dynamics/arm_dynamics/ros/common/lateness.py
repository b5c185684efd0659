# SPDX-License-Identifier: Apache-2.0
"""Durations that are too long, because a machine is too busy."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node

from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.diagnostics import PERIOD
from arm_dynamics.ros.common.executor import steady_timer

_LATE, _FACTOR = 0.05, 10.0  # [s], and of the usual duration; what exceeds both is too long
_BUSY = "the machine is too busy or a node too slow for the loop; tracking errors come from that"
_RARELY = 10.0  # [s] between log messages of a machine that is busy


class Lateness:
    """The longest of some durations in the last second, and a warning if it is too long.

    Attributes:
        longest: This duration in [s].
    """

    def __init__(self, node: Node, take: Callable[[], float], usual: float, text: str) -> None:
        """Start a timer.

        Args:
            node: The node.
            take: Returns the longest duration in [s] since the last call.
            usual: The usual duration in [s].
            text: Text of the warning, with a place for the duration.
        """
        self._bound, self._text = max(_LATE, _FACTOR * usual), f"{text}: {_BUSY}"
        self._take, self.longest = take, 0.0
        self._log = Throttled(node.get_logger(), period=_RARELY)
        self._timer = steady_timer(node, PERIOD, self.end_second)

    def end_second(self) -> None:
        """End a second; log the second warning in a row, since one is normal at the start."""
        before, self.longest = self.message, 0.0
        self.update()
        if before and (message := self.message):
            self._log.warning(message)

    def update(self) -> None:
        """Take the durations since the last call into account."""
        self.longest = max(self.longest, self._take())

    @property
    def message(self) -> str:
        """The warning; empty if there is no reason for one."""
        return self._text.format(self.longest) if self.longest > self._bound else ""
