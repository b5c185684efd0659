# SPDX-License-Identifier: Apache-2.0
"""The condition of a node: findings, durations that are too long, and ``/diagnostics``."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from arm_dynamics.exceptions import counted
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.common.conflicts import Alarm, complaint_of_same_name
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.interfaces import DIAGNOSTICS

PERIOD = 1.0  # [s]
OK, WARN, ERROR = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
_MIN_BOUND, _FACTOR = 0.05, 10.0  # [s], and of the usual duration; beyond both is too long
_CAUSE = "the machine is too busy or a node too slow for the loop; tracking errors come from that"
_LOG_PERIOD = 10.0  # [s] between log messages of a machine that is busy


@dataclass
class Finding:
    """Condition of one part of a node, with numbers and texts about it by name."""

    part: str
    values: dict[str, object] = field(default_factory=dict)
    _level: bytes = OK
    _messages: list[str] = field(default_factory=list)

    def add(self, level: bytes, message: str) -> None:
        """Add a warning or an error, if there is one; the worst level counts."""
        if message:
            self._level = max(self._level, level)
            self._messages.append(message)

    def message(self, node: Node) -> DiagnosticStatus:
        """The finding as a DiagnosticStatus."""
        return DiagnosticStatus(
            level=self._level,
            name=f"{node.get_fully_qualified_name().lstrip('/')}: {self.part}",
            message="; ".join(self._messages) or "ok",
            hardware_id=node.get_fully_qualified_name(),
            values=[KeyValue(key=key, value=_text(x)) for key, x in self.values.items()],
        )


class Growth:
    """Growth of counters since the last call."""

    def __init__(self) -> None:
        self._before: dict[str, int] = {}

    def update(self, name: str, count: int) -> int:
        """Register a counter, which may have been reset meanwhile; return its growth."""
        before, self._before[name] = self._before.get(name, 0), count
        return count - before if count >= before else count

    def warn(self, finding: Finding, count: int, noun: str, event: str) -> None:
        """Add a warning if the count of an event has grown; after a colon it may have reasons."""
        if growth := self.update(f"{noun} {event.partition(':')[0]}", count):
            finding.add(WARN, f"{counted(growth, noun)} {event}")


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
        self._bound, self._text = max(_MIN_BOUND, _FACTOR * usual), f"{text}: {_CAUSE}"
        self._take, self.longest = take, 0.0
        self._log = Throttled(node.get_logger(), period=_LOG_PERIOD)
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


class Diagnosis:
    """A timer that collects findings and publishes them while there are subscribers."""

    def __init__(self, node: Node, inspect: Callable[[], Sequence[Finding]]) -> None:
        self._node, self._inspect, self._same_name = node, inspect, Alarm(node)
        self._publisher = advertise(node, DIAGNOSTICS)
        self._timer = steady_timer(node, PERIOD, self.publish)

    @property
    def has_subscribers(self) -> bool:
        """Whether there are subscribers."""
        return self._publisher.get_subscription_count() > 0

    def publish(self) -> None:
        """Look for a node of the same name; publish the findings, if there are subscribers."""
        self._same_name.set(complaint_of_same_name(self._node))
        if not self.has_subscribers:
            return
        findings, executor = self._inspect(), self._node.executor
        findings[0].add(WARN, self._same_name.message)
        findings[0].values["executor"] = "none" if executor is None else type(executor).__name__
        message = DiagnosticArray(status=[finding.message(self._node) for finding in findings])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)
