# SPDX-License-Identifier: Apache-2.0
"""Log messages of the cores appear on the node's console and on /rosout."""

from __future__ import annotations

import logging

import pytest
from harness import Ros
from rcl_interfaces.msg import Log
from rclpy.node import Node

from arm_dynamics.logs import CORES, heard_by
from arm_dynamics.ros.common.executor import NodeHandler

pytestmark = pytest.mark.ros

INFO, WARN = 20, 30  # of rcl_interfaces/Log, whose constants are bytes in some releases


@pytest.mark.parametrize("core", CORES)
def test_a_node_publishes_log_messages_of_the_core(ros: Ros, core: str) -> None:
    node = ros.add(Node, "speaker")
    heard = ros.listen(Log, "/rosout")
    log, level = logging.getLogger(f"{core}.part"), logging.getLogger(core).level
    with heard_by(NodeHandler(node)):
        log.info("building %s", "something")
        log.warning("slower")
        log.debug("a detail")
        logging.getLogger("matplotlib").info("somebody else's affair")
    log.info("nobody listens any more")
    assert logging.getLogger(core).level == level
    node.get_logger().info("the end")
    ros.spin_until(lambda: any(message.msg == "the end" for message in heard))
    said = [(m.msg, m.level) for m in heard if m.name == "speaker"]
    assert said == [
        ("building something", INFO),
        ("slower", WARN),
        ("the end", INFO),
    ]


def test_a_log_that_fails_does_not_last(ros: Ros) -> None:
    node = ros.add(Node, "speaker")
    with pytest.raises(RuntimeError), heard_by(NodeHandler(node)):
        raise RuntimeError
    assert all(not logging.getLogger(core).handlers for core in CORES)
