# SPDX-License-Identifier: Apache-2.0
"""JointState as bytes, against the generated serializer and deserializer."""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from byte_order import sent
from rclpy.serialization import deserialize_message, serialize_message
from readers import PlainReader, said
from sensor_msgs.msg import JointState

import models
from arm_dynamics import InvalidInput
from arm_dynamics.ros.joint_state import Clip, JointStateFormat, JointStateReader
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
        expected = JointStateFormat(NAMES, ("position", "velocity"), partial, extra)
        return JointStateReader(expected, **options)

    return make


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
    expected = JointStateFormat(NAMES, ("position",), may_lack_joints=True, ignores_extra=True)
    readers = [kind(expected, clip=clip) for kind in (PlainReader, JointStateReader)]
    orders = [NAMES[:1], NAMES[1:], NAMES[::-1], ["hand", NAMES[2]], NAMES[2:], NAMES[:2]]
    for k in range(40):
        names = orders[k % 3] if k < 20 else orders[k % 6]  # more kinds than are known at once
        message = JointState(name=names, position=[0.1 * (k % 30) + i for i in range(len(names))])
        message.header.stamp.sec = k
        python, compiled = (said(reader, serialize_message(message)) for reader in readers)
        assert compiled == python


ORDER = ("effort", "position", "velocity")
FOLLOWERS = {
    "within rounding": ({"position": [0.03, -0.0115, 0.2]}, ""),
    "without a number": ({"position": [0.03, float("nan"), 0.2]}, ""),
    "of all fields": (
        {"position": [0.03, -0.011, 0.2], "velocity": [0.1, -0.07, 0], "effort": [5.0, 0, 1]}, ""
    ),
    "with an effort": ({"effort": [5.0, 5.0, 1.0]}, "follows left_slide, so 0 is expected"),
    "without its leader's number": (
        {"position": [float("nan"), 0.01, 0.2]}, "right_slide follows left_slide; command that one"
    ),
}  # fmt: skip


@pytest.mark.parametrize(("fields", "words"), FOLLOWERS.values(), ids=FOLLOWERS)
def test_mimic_joints_may_be_named_if_they_agree(fields: dict[str, Any], words: str) -> None:
    """The first message of a kind is read in Python, the next ones in C alone."""
    arm = models.dynamics("gripper").model.joint_names
    reader = JointStateReader(
        JointStateFormat(arm, ORDER, may_lack_joints=True, may_have_gaps=True)
    )
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


def test_useless_messages_are_refused_and_their_numbers_are_not_kept(reader: Readers) -> None:
    read = reader(partial=True)
    for message, complaint in (
        (state(position=[1.0, 2.0, 3.0]), "velocity has 0 numbers for 3 joints"),
        (
            state(position=[1.0, np.nan, 3.0], velocity=[5.0] * 3),
            "position of joint 'elbow' is nan; allowed: finite numbers",
        ),
        (JointState(name=["base"] * 3, position=[0.0] * 3, velocity=[0.0] * 3), "all different"),
        (JointState(), "names no joints; allowed: base, elbow, wrist_é"),
    ):
        with pytest.raises(InvalidInput, match=complaint):
            read.read(serialize_message(message))
    part = JointState(name=NAMES[:1], position=[1.0], velocity=[1.0])
    np.testing.assert_array_equal(read.read(serialize_message(part))[1], [[1, 0, 0], [1, 0, 0]])


INFINITIES = 0x7FF0000000000000, 0xFFF0000000000000
NANS = 0x7FF8000000000000, 0xFFF8000000000000, 0x7FF0000000000001, 0x7FFFFFFFFFFFFFFF


def test_no_number_that_is_not_finite_gets_past_a_layout_that_is_known(reader: Readers) -> None:
    read, good = reader(), np.arange(6.0)
    for _ in range(3):  # C knows what came twice
        read.read(serialize_message(state(position=good[:3].tolist(), velocity=good[3:].tolist())))
    for place, bits in product(range(6), INFINITIES + NANS):
        bad = good.copy()
        bad.view(np.uint64)[place] = bits
        message = state(position=bad[:3].tolist(), velocity=bad[3:].tolist())
        with pytest.raises(InvalidInput, match="allowed: finite numbers"):
            read.read(serialize_message(message))


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
