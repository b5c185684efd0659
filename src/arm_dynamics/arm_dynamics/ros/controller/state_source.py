# SPDX-License-Identifier: Apache-2.0
"""One publisher of joint states is followed; those of others, of the same arm, are ignored."""

import time

from rclpy.node import Node

from arm_dynamics.ros.common.conflicts import Alarm, complaint_of_publishers, publishers
from arm_dynamics.ros.common.diagnostics import PERIOD
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.controller.controller_library import HEADER
from arm_dynamics.ros.interfaces import JOINT_STATES

SILENCE = 1_000_000_000  # [ns] for which others must be heard alone; load may delay one
MIN_STATES = 5  # states of others: after this process was stopped, one may come first by chance


class StateSource:
    """Follows the first publisher of states until it falls silent, and reports others.

    Answered as one, two sims would both obey commands that suit one of them.

    Attributes:
        shared: ``publishers_t`` of answers.h, for C.
        alarm: On while another one publishes.
    """

    def __init__(self, node: Node) -> None:
        """Look once a second whether there is another one."""
        self._node, self._topic = node, node.resolve_topic_name(JOINT_STATES.name)
        self.shared, self.alarm = HEADER.structure("publishers_t")(), Alarm(node)
        self._since = self._count = 0  # since when others are heard alone, and how often
        self._timer = steady_timer(node, PERIOD, self.check_conflict)

    def accept(self, sender: bytes) -> bool:
        """Whether a state that has come now is of the publisher that is followed."""
        shared, now = self.shared, time.monotonic_ns()
        if shared.last_time and sender != bytes(shared.sender):
            shared.other[:], shared.other_time = sender, now
            if not self._count_other(now):
                return False
            shared.other_time = 0  # it is the followed one now
        shared.sender[:], shared.last_time = sender, now
        return True

    def _count_other(self, now: int) -> bool:
        """Count a state of another one; whether it has been heard alone for long enough."""
        if self.shared.last_time >= self._since:
            self._since, self._count = now, 0
        self._count += 1
        return self._count >= MIN_STATES and now - self._since > SILENCE

    def check_conflict(self) -> None:
        """Look whether both were heard within the last half second."""
        shared, message = self.shared, ""
        if time.monotonic_ns() - min(shared.last_time, shared.other_time) < SILENCE // 2:
            names, topic = publishers(self._node, self._topic), self._topic
            leader = f"'{names.get(bytes(shared.sender), 'unknown')}', which is followed"
            other = f"'{names.get(bytes(shared.other), 'unknown')}', which is not"
            message = complaint_of_publishers(topic, leader, other)
        self.alarm.set(message)
