# SPDX-License-Identifier: Apache-2.0
"""One publisher of joint states is followed; those of others, of the same arm, are ignored."""

from __future__ import annotations

import time
from ctypes import addressof, byref

from rclpy.node import Node

from arm_dynamics.ros.common.diagnostics import PERIOD, publishers, two_publish
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.controller.controller_library import HEADER, library
from arm_dynamics.ros.interfaces import JOINT_STATES

SILENCE = 1_000_000_000  # [ns] after which a publisher is gone; a busy machine may delay one


class Followed:
    """Follows the first publisher of states until it falls silent, and reports others.

    Answered as one, two sims would both obey commands that suit one of them.

    Attributes:
        complaint: Who publishes states besides; empty if nobody does.
    """

    def __init__(self, node: Node) -> None:
        """Report once a second to the node's log."""
        self._node, self._topic = node, node.resolve_topic_name(JOINT_STATES.name)
        self._shared = HEADER.structure("followed_t")(patience=SILENCE)
        self.complaint = ""
        self._timer = steady_timer(node, PERIOD, self.look)

    @property
    def place(self) -> int:
        """Address of ``followed_t``, which C uses for the states that it takes."""
        return addressof(self._shared)

    def includes(self, sender: bytes) -> bool:
        """Whether a state that has come now is of the publisher that is followed."""
        return bool(library().is_followed(byref(self._shared), sender, time.monotonic_ns()))

    def look(self) -> None:
        """Look whether another publisher was heard as well within the last second."""
        before, self.complaint, both = self.complaint, "", self._shared.both
        if both and time.monotonic_ns() - both <= SILENCE:
            self.complaint = before or self._words()
        if self.complaint and not before:
            self._node.get_logger().error(self.complaint)

    def _words(self) -> str:
        names = publishers(self._node, self._topic)
        followed, other = (
            f"'{names.get(bytes(who), 'a node that is gone')}'"
            for who in (self._shared.followed, self._shared.other)
        )
        return two_publish(self._topic, f"{followed}, which is followed", f"{other}, which is not")
