# SPDX-License-Identifier: Apache-2.0
"""Log messages of the cores appear on the node's console; what is repeated is told in turns."""

import logging
from contextlib import suppress

import pytest
from harness import Ros
from rcl_interfaces.msg import Log
from rclpy.node import Node

from arm_dynamics.logs import MOST_REASONS, PERIOD, Throttled, heard_by
from arm_dynamics.ros.common.executable import NodeHandler

pytestmark = pytest.mark.ros

INFO, WARN = 20, 30  # of rcl_interfaces/Log, whose constants are bytes in some releases


def test_a_node_publishes_log_messages_of_the_cores(ros: Ros) -> None:
    node = ros.add(Node, "speaker")
    heard = ros.listen(Log, "/rosout")
    log, level = logging.getLogger("arm_sim.part"), logging.getLogger("arm_sim").level
    with suppress(RuntimeError), heard_by(NodeHandler(node)):
        log.info("building %s", "something")
        log.warning("slower")
        log.debug("a detail")
        logging.getLogger("matplotlib").info("somebody else's affair")
        raise RuntimeError
    log.info("nobody listens any more")
    assert logging.getLogger("arm_sim").level == level
    node.get_logger().info("the end")
    ros.spin_until(lambda: any(message.msg == "the end" for message in heard))
    said = [(m.msg, m.level) for m in heard if m.name == "speaker"]
    assert said == [("building something", INFO), ("slower", WARN), ("the end", INFO)]


class Steady:
    """A log and its clock."""

    def __init__(self) -> None:
        self.now, self.lines = 100.0, list[str]()
        self.info = self.warning = self.error = self.lines.append
        self.throttled = Throttled(self, lambda: self.now)

    def told(self) -> int:
        """Number of lines since the last look."""
        count = len(self.lines)
        self.lines.clear()
        return count


def test_each_reason_is_told_and_its_repetitions_are_not() -> None:
    log = Steady()
    for value in (0.5, -1e-9, 3):  # a reason whatever its numbers
        log.throttled.warning(f"torque {value} of joint 'elbow2' is clipped")
    log.throttled.warning("torque 0.5 of joint 'elbow3' is clipped")
    log.throttled.error("no robot")
    assert log.told() == 3
    for duration in (1, 2, 2):  # unless they are part of it
        log.throttled.error(text := f"goal of {duration} s refused", text)
    assert log.told() == 2


def test_a_flood_of_reasons_is_limited_and_does_not_last() -> None:
    log = Steady()
    for k in range(100):
        log.throttled.warning(f"unknown joint 'x{k}'")
    assert log.told() == MOST_REASONS
    log.now += PERIOD
    log.throttled.warning("unknown joint 'x7'")
    assert log.told() == 1
