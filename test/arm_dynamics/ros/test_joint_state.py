# SPDX-License-Identifier: Apache-2.0
"""JointState as bytes, against the generated serializer and deserializer; sent and taken in C."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from byte_order import sent
from harness import Ros
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from readers import PlainReader, said
from sensor_msgs.msg import JointState

import models
from arm_dynamics import InvalidInput
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, JOINT_STATES, Topic
from arm_dynamics.ros.joint_state import (
    NONE,
    Clip,
    Expected,
    JointStateReader,
    JointStateSink,
    Read,
)
from arm_dynamics.ros.joint_state import reader as reading
from arm_dynamics.ros.joint_state.serialization import FIELDS, JointStateWriter

pytestmark = pytest.mark.ros

NAMES = ["base", "elbow", "wrist_é"]
Readers = Callable[..., JointStateReader]


def state(**fields: list[float]) -> JointState:
    return JointState(name=NAMES, **fields)


@pytest.fixture
def reader() -> Readers:
    """Makes a reader of positions and velocities."""

    def make(partial: bool = False, extra: bool = False, **options: Any) -> JointStateReader:
        expected = Expected(NAMES, ("position", "velocity"), partial, extra)
        return JointStateReader(expected, **options)

    return make


def test_a_message_with_any_byte_changed_is_read_as_the_generated_deserializer_reads_it() -> None:
    expected = Expected(NAMES, ("position", "velocity"))
    raw = serialize_message(state(position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0, 6.0]))
    python, compiled = PlainReader(expected), JointStateReader(expected)
    for at in range(len(raw)):
        changed = bytearray(raw)
        changed[at] ^= 0xFF
        assert said(compiled, bytes(changed)) == said(python, bytes(changed)), f"byte {at}"
        assert said(compiled, raw) == said(python, raw)  # of a layout that is known


def test_what_is_written_is_read_by_the_generated_deserializer(rng: np.random.Generator) -> None:
    """Names and frames of any length, some of the fields."""
    for _ in range(200):
        count = int(rng.integers(0, 7))
        names = [
            "".join(rng.choice(list("abcé"), rng.integers(0, 9))) + str(i) for i in range(count)
        ]
        fields = [field for field in FIELDS if rng.random() < 0.7]
        arrays = rng.normal(size=(len(fields), count))
        message = JointState(name=names, **dict(zip(fields, arrays.tolist(), strict=True)))
        message.header.frame_id = "x" * int(rng.integers(0, 9))
        stamp = int(rng.integers(-(2**60), 2**60))
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        written = bytes(
            JointStateWriter(names, fields, message.header.frame_id).write(stamp, *arrays)
        )
        assert deserialize_message(written, JointState) == message


def test_messages_written_earlier_do_not_change() -> None:
    writer = JointStateWriter(NAMES, ("effort",))
    first = writer.write(1, np.ones(3))
    kept = bytes(first)
    writer.write(2, np.zeros(3))
    assert first == kept


def test_arrays_of_another_number_or_size_are_not_written() -> None:
    writer = JointStateWriter(NAMES, ("effort",))
    for arrays in ([], [np.zeros(3)] * 2, [np.zeros(2)], [np.zeros(4)], [np.zeros(1)]):
        with pytest.raises(ValueError):
            writer.write(0, *arrays)


def test_reads_the_other_byte_order(reader: Readers) -> None:
    message = state(position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0, 6.0])
    message.header.stamp.sec = 7
    at, values = reader().read(sent(message, ">"))
    assert at == 7 * 10**9
    np.testing.assert_array_equal(values, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


def test_publishers_of_some_joints_in_turn_are_read_alike_by_both() -> None:
    clip = Clip([2.0] * 3, lambda numbers: tuple(min(x, 2.0) for x in numbers))
    expected = Expected(NAMES, ("position",), partial=True, extra=True)
    readers = [kind(expected, clip=clip) for kind in (PlainReader, JointStateReader)]
    orders = [NAMES[:1], NAMES[1:], NAMES[::-1], ["hand", NAMES[2]], NAMES[2:], NAMES[:2]]
    for k in range(40):
        names = orders[k % 3] if k < 20 else orders[k % 6]  # more kinds than are known at once
        message = JointState(name=names, position=[0.1 * (k % 30) + i for i in range(len(names))])
        message.header.stamp.sec = k
        python, compiled = (said(reader, serialize_message(message)) for reader in readers)
        assert compiled == python


def test_extra_joints_are_passed_over_when_allowed(reader: Readers) -> None:
    message = JointState(name=["hand", *NAMES], position=[9.0, 1, 2, 3], velocity=[9.0, 4, 5, 6])
    raw = serialize_message(message)
    np.testing.assert_array_equal(reader(extra=True).read(raw)[1], [[1, 2, 3], [4, 5, 6]])
    with pytest.raises(InvalidInput, match="unknown joints hand; allowed: base, elbow"):
        reader().read(raw)


ORDER = ("effort", "position", "velocity")
FOLLOWERS = {
    "within rounding": ({"position": [0.03, -0.0115, 0.2]}, ""),
    "without a number": ({"position": [0.03, float("nan"), 0.2]}, ""),
    "of all fields": (
        {"position": [0.03, -0.011, 0.2], "velocity": [0.1, -0.07, 0], "effort": [5.0, 0, 1]}, ""
    ),
    "contradicting": ({"position": [0.03, 0.03, 0.2]}, "right_slide is 0.03, but right_slide f"),
    "in velocity": ({"velocity": [0.1, 0.1, 0.0]}, "velocity: right_slide is 0.1, but"),
    "with an effort": ({"effort": [5.0, 5.0, 1.0]}, "follows left_slide, so 0 is expected"),
    "without its leader's number": (
        {"position": [float("nan"), 0.01, 0.2]}, "right_slide follows left_slide; command that one"
    ),
}  # fmt: skip


@pytest.mark.parametrize(("fields", "words"), FOLLOWERS.values(), ids=FOLLOWERS)
def test_mimic_joints_may_be_named_if_they_agree(fields: dict[str, Any], words: str) -> None:
    """The first message of a kind is read in Python, the next ones in C alone."""
    arm = models.dynamics("gripper").model.joint_names
    reader = JointStateReader(Expected(arm, ORDER, partial=True, gaps=True))
    names = ["left_slide", "right_slide", "swing"]
    raw = serialize_message(JointState(name=names, **fields))
    other = reading.HEADER.constants["OTHER"]
    for outcome in (other, other if words else reading.KNOWN):
        assert reader._read(raw, len(raw)) == outcome
        if words:
            with pytest.raises(InvalidInput, match=words):
                reader.read(raw)
            continue
        for field, row in zip(ORDER, reader.read(raw)[1], strict=True):
            given = fields.get(field, [np.nan] * 3)
            np.testing.assert_array_equal(row, [given[2], given[0]])


def test_absent_joints_keep_their_numbers_when_allowed(reader: Readers) -> None:
    read = reader(partial=True)
    whole = state(position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0, 6.0])
    part = JointState(name=NAMES[1:2], position=[7.0], velocity=[8.0])
    first = reader(partial=True).read(serialize_message(part))
    np.testing.assert_array_equal(first[1], [[0, 7, 0], [0, 8, 0]])
    read.read(serialize_message(whole))
    np.testing.assert_array_equal(read.read(serialize_message(part))[1], [[1, 7, 3], [4, 8, 6]])
    with pytest.raises(InvalidInput, match="joints base, wrist_é are missing"):
        reader().read(serialize_message(part))


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (state(position=[1.0, 2.0, 3.0]), "velocity has 0 numbers for 3 joints"),
        (
            state(position=[1.0, np.nan, 3.0], velocity=[0.0] * 3),
            "position of joint 'elbow' is nan; allowed: finite numbers",
        ),
        (state(position=[1.0] * 3, velocity=[0.0, 0.0, np.inf]), "'wrist_é' is inf"),
        (JointState(name=["base"] * 3, position=[0.0] * 3, velocity=[0.0] * 3), "all different"),
        (JointState(), "names no joints; allowed: base, elbow, wrist_é"),
    ],
)
def test_useless_messages_are_refused(
    message: JointState, complaint: str, reader: Readers
) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        reader().read(serialize_message(message))


INFINITIES = 0x7FF0000000000000, 0xFFF0000000000000
NANS = 0x7FF8000000000000, 0xFFF8000000000000, 0x7FF0000000000001, 0x7FFFFFFFFFFFFFFF


@pytest.mark.parametrize("place", range(6))
def test_no_number_that_is_not_finite_gets_past_a_layout_that_is_known(
    place: int, reader: Readers
) -> None:
    read, good = reader(), np.arange(6.0)
    for _ in range(3):  # C knows what came twice
        read.read(serialize_message(state(position=good[:3].tolist(), velocity=good[3:].tolist())))
    for bits in INFINITIES + NANS:
        bad = good.copy()
        bad.view(np.uint64)[place] = bits
        message = state(position=bad[:3].tolist(), velocity=bad[3:].tolist())
        with pytest.raises(InvalidInput, match="allowed: finite numbers"):
            read.read(serialize_message(message))


def test_refused_numbers_are_not_kept(reader: Readers) -> None:
    read = reader(partial=True)
    with pytest.raises(InvalidInput):
        read.read(serialize_message(state(position=[np.nan] * 3, velocity=[5.0] * 3)))
    part = JointState(name=NAMES[:1], position=[1.0], velocity=[1.0])
    np.testing.assert_array_equal(read.read(serialize_message(part))[1], [[1, 0, 0], [1, 0, 0]])


def test_numbers_beyond_their_limit_are_replaced(reader: Readers) -> None:
    told: list[tuple[float, ...]] = []
    instead = (0.5, 0.5, 0.5)
    clip = Clip([1.0, np.inf, 3.0], lambda numbers: told.append(numbers) or instead)
    read = reader(clip=clip)
    for position in ([1.0, 99.0, -3.0], [1.0, 0.0, -3.1], [-1.1, 0.0, 0.0], [0.0, 0.0, 0.0]):
        message = state(position=position, velocity=[9.0] * 3)
        taken = read.read(serialize_message(message))[1]
        assert taken[0] == (instead if tuple(position) in told else tuple(position))
        assert taken[1] == (9.0, 9.0, 9.0)
    assert told == [(1.0, 0.0, -3.1), (-1.1, 0.0, 0.0)]


def test_who_speaks_is_told_of_every_message(reader: Readers) -> None:
    told: list[tuple[str, frozenset[int]]] = []
    read = reader(partial=True, admit=lambda who, joints: told.append((who, joints)))
    for who, names in (("a", NAMES), ("b", NAMES), ("a", NAMES), ("a", NAMES[1:]), ("a", NAMES)):
        message = JointState(name=names, position=[0.0] * len(names), velocity=[0.0] * len(names))
        message.header.frame_id = who
        read.read(serialize_message(message))
    whole = frozenset({0, 1, 2})
    assert told == [("a", whole), ("b", whole), ("a", whole), ("a", whole - {0}), ("a", whole)]


JOINTS = NAMES[:2]
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
    assert reader.addresses[0]
    source.close()
    assert not reader.addresses[0]  # what it has given back
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
