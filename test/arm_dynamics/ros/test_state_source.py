# SPDX-License-Identifier: Apache-2.0
"""A controller answers one of several publishers of joint states, and names the others."""

from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from harness import Ros
from rclpy.node import Node
from sensor_msgs.msg import JointState
from two_link_control import MS, state

import models
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.common.conflicts import publishers
from arm_dynamics.ros.controller.state_source import StateSource
from arm_dynamics.ros.interfaces import JOINT_STATES

pytestmark = [pytest.mark.ros, pytest.mark.skipif(find_compiler() is None, reason="no C compiler")]

FIRST, SECOND, THIRD = (bytes([k]) * 16 for k in (1, 2, 3))


class Heard:
    """States of publishers, by turns, at times in [ms]."""

    def __init__(self, ros: Ros, monkeypatch: pytest.MonkeyPatch) -> None:
        self.source, self._now = StateSource(ros.peer), 0
        clock = SimpleNamespace(monotonic_ns=lambda: self._now * MS)
        monkeypatch.setattr("arm_dynamics.ros.controller.state_source.time", clock)

    def __call__(self, sender: bytes, now: int) -> bool:
        self._now = 10_000 + now
        return self.source.accept(sender)

    def complaint(self, now: int) -> str:
        self._now = 10_000 + now
        self.source.check_conflict()
        return self.source.alarm.message


@pytest.fixture
def heard(ros: Ros, monkeypatch: pytest.MonkeyPatch) -> Heard:
    return Heard(ros, monkeypatch)


def test_the_first_is_followed_as_long_as_it_speaks(heard: Heard) -> None:
    assert heard(FIRST, 1)
    assert not heard.complaint(2)
    for now in range(2, 5000, 10):
        assert not heard(SECOND, now)
        assert not heard(THIRD, now)
        assert heard(FIRST, now + 1)
    assert bytes(heard.source.shared.other) == THIRD
    assert heard.complaint(5000) and not heard.complaint(6000)


def test_who_speaks_alone_for_a_second_is_followed(heard: Heard) -> None:
    assert heard(FIRST, 1)
    assert not any(heard(SECOND, now) for now in range(600, 1601, 10))
    assert not heard.complaint(1601)  # it is a successor
    assert heard(SECOND, 1601)
    assert not heard.complaint(1602)
    assert not heard(FIRST, 1602)
    assert heard(SECOND, 1603)


def test_a_second_robot_is_not_answered_and_named(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = ros.adopt(
        ControllerNode(models.scene("two_link"), own_thread=True, context=ros.context)
    )
    commands = ros.listen(JointState, "/joint_commands", 200)
    one, other = (
        ros.adopt(Node(name, context=ros.context)).create_publisher(
            JointState, JOINT_STATES.name, 10
        )
        for name in ("one", "other")
    )
    ros.spin_until(lambda: one.get_subscription_count() and other.get_subscription_count())
    assert set(publishers(ros.peer, "/joint_states").values()) == {"/one", "/other"}
    gripper = JointState(name=["finger"], position=[0.0], velocity=[0.0])
    other.publish(gripper)  # which is nobody's rival
    for k in range(1, 100):
        one.publish(state(2 * k * MS))
        ros.spin_until(lambda k=k: len(commands) >= k)
        other.publish(state((2 * k + 1) * MS))
    assert not any(message.header.stamp.nanosec % (2 * MS) for message in commands)
    node._source.check_conflict()
    (finding,) = node.diagnostics()
    status = finding.message(node)
    assert status.level == DiagnosticStatus.ERROR
    assert "two nodes publish /joint_states: '/one', which is followed" in status.message
    assert "'/other', which is not; allowed: one." in status.message
    assert "-r __ns:=" in status.message and "ROS_DOMAIN_ID" in status.message
    assert "two nodes publish" in capfd.readouterr().err
