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
    assert not heard(FIRST, 1602)
    assert heard(SECOND, 1603)


@pytest.mark.parametrize("before", [0, 1])
def test_a_pause_of_the_controller_changes_nothing(before: int, heard: Heard) -> None:
    """It may first hear the other one after it."""
    assert heard(FIRST, 1)
    for _ in range(before):
        assert not heard(SECOND, 2)
    assert not heard(SECOND, 3000)
    assert heard(FIRST, 3001)
    assert not heard(SECOND, 3002)


class Robot:
    """Publishes states of the arm, or of other joints, as a node of its own."""

    def __init__(self, ros: Ros, name: str) -> None:
        self.node = ros.adopt(Node(name, context=ros.context))
        self._topic = self.node.create_publisher(JointState, JOINT_STATES.name, 10)
        ros.spin_until(self._topic.get_subscription_count)

    def tell(self, stamp: int) -> None:
        self._topic.publish(state(stamp))

    def tell_of_a_gripper(self) -> None:
        self._topic.publish(JointState(name=["finger"], position=[0.0], velocity=[0.0]))


class Led:
    """A controller with a thread of its own, and stamps of what it has answered."""

    def __init__(self, ros: Ros) -> None:
        self._ros, self.stamps = ros, list[int]()
        self.node = ros.adopt(
            ControllerNode(models.scene("two_link"), own_thread=True, context=ros.context)
        )
        ros.peer.create_subscription(JointState, "joint_commands", self._note, 100)
        ros.spin_until(lambda: ros.peer.count_publishers("joint_commands"))

    def _note(self, message: JointState) -> None:
        self.stamps.append(message.header.stamp.nanosec)

    def until_answered(self, stamp: int) -> None:
        self._ros.spin_until(lambda: stamp in self.stamps)

    def found(self) -> DiagnosticStatus:
        self.node._source.check_conflict()
        (finding,) = self.node.diagnostics()
        return finding.message(self.node)


def test_a_second_robot_is_not_answered_and_named(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    led, one, other = Led(ros), Robot(ros, "one"), Robot(ros, "other")
    assert set(publishers(ros.peer, "/joint_states").values()) == {"/one", "/other"}
    other.tell_of_a_gripper()  # which is nobody's rival
    for k in range(1, 200, 2):
        one.tell(k * MS)
        led.until_answered(k * MS)
        other.tell((k + 1) * MS)
    assert all(stamp % (2 * MS) for stamp in led.stamps)
    status = led.found()
    assert status.level == DiagnosticStatus.ERROR
    assert "two nodes publish /joint_states: '/one', which is followed" in status.message
    assert "'/other', which is not; allowed: one." in status.message
    assert "-r __ns:=" in status.message and "ROS_DOMAIN_ID" in status.message
    assert "two nodes publish" in capfd.readouterr().err


def test_a_successor_is_answered_after_a_second_without_complaint(ros: Ros) -> None:
    led, one = Led(ros), Robot(ros, "one")
    one.tell(MS)
    led.until_answered(MS)
    successor, stamp = Robot(ros, "one"), 2 * MS
    while len(led.stamps) < 3:
        stamp += MS
        successor.tell(stamp)
        ros.spin_once(0.05)
    assert "two nodes publish" not in led.found().message


def test_a_gripper_beside_the_arm_is_no_second_robot(ros: Ros) -> None:
    led, gripper, arm = Led(ros), Robot(ros, "gripper"), Robot(ros, "arm")
    for k in range(1, 20):
        gripper.tell_of_a_gripper()
        arm.tell(k * MS)
        led.until_answered(k * MS)
    assert "two nodes publish" not in led.found().message
