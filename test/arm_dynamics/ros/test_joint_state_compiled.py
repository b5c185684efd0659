# SPDX-License-Identifier: Apache-2.0
"""JointStates published and taken in one call of C each."""

import ctypes
import time

import numpy as np
import pytest
from harness import Ros
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, JOINT_STATES, Topic
from arm_dynamics.ros.joint_state import NONE, Expected, JointStateReader, JointStateSink, Read
from arm_dynamics.ros.joint_state.serialization import JointStateWriter

pytestmark = pytest.mark.ros

JOINTS = ["base", "elbow"]
PATIENCE = 60.0  # [s]


class Source:
    """Messages of a topic, received in C."""

    def __init__(self, node: Node, topic: Topic, reader: JointStateReader) -> None:
        self._newest, self._reader = PolledSubscription(node, topic), reader
        reader.open(self._newest.pointer)

    def take(self) -> tuple[int, Read] | None:
        """Arrival and content of the next message, if there is one."""
        if self._reader.take() == NONE:
            return None
        return self._reader.arrival, self._reader.read(self._reader.raw)

    def close(self) -> None:
        """End the subscription."""
        self._reader.close()
        self._newest.close()


def next_of(source: Source) -> tuple[int, Read]:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if (taken := source.take()) is not None:
            return taken
        time.sleep(0.001)
    pytest.fail("no message came")


def matched(node: Node, topic: str) -> None:
    end = time.monotonic() + PATIENCE
    while not (node.count_subscribers(topic) and node.count_publishers(topic)):
        assert time.monotonic() < end, "the two ends did not find each other"
        time.sleep(0.01)
    time.sleep(0.2)


def test_what_is_published_arrives(ros: Ros) -> None:
    node = ros.add(Node, "both")
    arrays = [np.zeros(2) for _ in range(3)]
    writer = JointStateWriter(JOINTS, frame_id="here")
    sink = JointStateSink(node, JOINT_STATES, writer, arrays)
    reader = JointStateReader(Expected(JOINTS, ("position", "effort")))
    source, bytes_of = Source(node, JOINT_STATES, reader), PolledSubscription(node, JOINT_STATES)
    matched(node, JOINT_STATES.name)
    assert source.take() is None
    for stamp in (0, 999_999_999, 12_345_678_901_234, -1):
        for k, array in enumerate(arrays):
            array[:] = [stamp + k, 1e-3 * k]
        before = time.time_ns()
        sink.send(stamp)
        arrival, (at, values) = next_of(source)
        assert at == stamp
        assert before - 1_000_000 <= arrival <= time.time_ns()
        assert values == [tuple(arrays[0]), tuple(arrays[2])]
        raw = None
        while raw is None:
            raw = bytes_of.take()
        message = deserialize_message(raw[0], JointState)
        assert (message.header.frame_id, message.name) == ("here", JOINTS)
        assert bytes(raw[0]) == writer.write(stamp, *arrays)
    assert source.take() is None
    assert reader.places[0]
    source.close()
    assert not reader.places[0]  # what it has given back
    bytes_of.close()


def test_bad_messages_on_the_way_are_refused_and_good_ones_go_on(ros: Ros) -> None:
    node = ros.add(Node, "both")
    publisher = node.create_publisher(JointState, JOINT_COMMANDS.name, 10)
    reader = JointStateReader(Expected(JOINTS, ("effort",)))
    source = Source(node, JOINT_COMMANDS, reader)
    matched(node, JOINT_COMMANDS.name)
    for _ in range(2):
        publisher.publish(JointState(name=JOINTS, effort=[1.0, 2.0]))
        assert next_of(source)[1][1] == [(1.0, 2.0)]
        for effort, complaint in (([1.0, np.nan], "'elbow' is nan"), ([1.0], "1 numbers for 2")):
            publisher.publish(JointState(name=JOINTS, effort=effort))
            with pytest.raises(InvalidInput, match=complaint):
                next_of(source)
    source.close()
    assert source.take() is None


class Message(ctypes.Structure):
    """``rcutils_uint8_array_t``."""

    _fields_ = (
        ("buffer", ctypes.c_void_p), ("length", ctypes.c_size_t), ("capacity", ctypes.c_size_t),
        ("allocator", ctypes.c_void_p * 5),
    )  # fmt: skip


class Memory(ctypes.Structure):
    """``source_t`` of joint_state.c."""

    _fields_ = (("subscription", ctypes.c_void_p), ("message", Message))


def test_memory_of_a_giant_message_is_given_back(ros: Ros) -> None:
    node = ros.add(Node, "both")
    publisher = node.create_publisher(JointState, JOINT_COMMANDS.name, 10)
    reader = JointStateReader(Expected(JOINTS, ("effort",)))
    source = Source(node, JOINT_COMMANDS, reader)
    matched(node, JOINT_COMMANDS.name)
    room = []
    for frame_id in ("", "", "x" * 200_000, "", ""):
        message = JointState(name=JOINTS, effort=[1.0, 2.0])
        message.header.frame_id = frame_id
        publisher.publish(message)
        assert next_of(source)[1][1] == [(1.0, 2.0)]
        room.append(Memory.from_address(reader._memory.value).message.capacity)
    source.close()
    assert room[2] >= 200_000
    assert max(room[:2] + room[3:]) < 1000


def test_who_can_no_longer_publish_is_told_why(ros: Ros) -> None:
    node = ros.add(Node, "gone")
    sink = JointStateSink(node, JOINT_STATES, JointStateWriter(JOINTS), [np.zeros(2)] * 3)
    sink.send(0)
    node.context.try_shutdown()
    with pytest.raises(Exception, match="publish"):
        sink.send(1)
