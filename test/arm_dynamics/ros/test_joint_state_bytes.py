# SPDX-License-Identifier: Apache-2.0
"""JointState as bytes, against the generated serializer and deserializer."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from byte_order import sent
from rclpy.serialization import deserialize_message, serialize_message
from readers import PlainReader, said
from sensor_msgs.msg import JointState

import models
from arm_dynamics import InvalidInput
from arm_dynamics.ros.joint_state import Clip, Expected, JointStateReader
from arm_dynamics.ros.joint_state import reader as reading
from arm_dynamics.ros.joint_state.serialization import (
    FIELDS,
    JointStateWriter,
    Layout,
    layout_of,
    parsed,
)

pytestmark = pytest.mark.ros

NAMES = ["base", "elbow", "wrist_é"]
Readers = Callable[..., JointStateReader]


def random_message(rng: np.random.Generator) -> JointState:
    """Names and frames of any length, arrays that may be absent."""
    count = int(rng.integers(0, 7))
    names = ["".join(rng.choice(list("abcé"), rng.integers(0, 9))) + str(i) for i in range(count)]
    message = JointState(name=names)
    message.header.frame_id = "x" * int(rng.integers(0, 9))
    message.header.stamp.sec = int(rng.integers(-(2**31), 2**31))
    message.header.stamp.nanosec = int(rng.integers(0, 10**9))
    for field in FIELDS:
        if rng.random() < 0.7:
            setattr(message, field, rng.normal(size=rng.choice([count, count, 3])).tolist())
    return message


def state(**fields: list[float]) -> JointState:
    return JointState(name=NAMES, **fields)


@pytest.fixture
def reader() -> Readers:
    """Makes a reader of positions and velocities."""

    def make(partial: bool = False, extra: bool = False, **options: Any) -> JointStateReader:
        expected = Expected(NAMES, ("position", "velocity"), partial, extra)
        return JointStateReader(expected, **options)

    return make


def layout(message: JointState) -> Layout:
    lengths = [len(getattr(message, field)) for field in FIELDS]
    return layout_of(message.header.frame_id, message.name, lengths)


def has(layout: Layout, raw: bytes) -> bool:
    """Whether a message has a layout."""
    pairs = zip(raw, layout.fixed, layout.expected, strict=False)
    here = all(byte & fixed == expected for byte, fixed, expected in pairs)
    return len(raw) >= len(layout.fixed) and here


def numbers(layout: Layout, raw: bytes, message: JointState) -> list[bytes]:
    """Position, velocity and effort where the layout of ``message`` says."""
    lengths = [8 * len(getattr(message, field)) for field in FIELDS]
    return [raw[at : at + size] for at, size in zip(layout.places, lengths, strict=True)]


def in_message(message: JointState) -> list[bytes]:
    return [getattr(message, field).tobytes() for field in FIELDS]


def test_layout_is_that_of_the_generated_serializer(rng: np.random.Generator) -> None:
    for _ in range(300):
        message = random_message(rng)
        raw, found = serialize_message(message), layout(message)
        assert has(found, raw)
        assert numbers(found, raw, message) == in_message(message)


def test_layout_notices_every_byte_that_matters() -> None:
    message = state(position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0, 6.0])
    raw, found = bytearray(serialize_message(message)), layout(message)
    for at in range(len(found.fixed)):
        changed = bytearray(raw)
        changed[at] ^= 0xFF
        if not has(found, changed):
            continue
        try:
            other = deserialize_message(bytes(changed), JointState)
        except Exception:
            pytest.fail(f"byte {at} makes it unreadable, and was not noticed")
        assert other.name == message.name
        assert numbers(found, bytes(changed), message) == in_message(other)


def test_written_bytes_are_those_of_the_generated_serializer(rng: np.random.Generator) -> None:
    """Byte by byte, but for the padding, in which a serializer leaves what was there before."""
    for _ in range(200):
        message = random_message(rng)
        length = len(message.name)
        fields = [field for field in FIELDS if len(getattr(message, field)) == length]
        for field in set(FIELDS) - set(fields):
            setattr(message, field, [])
        raw = serialize_message(message)
        found = layout(message)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        arrays = [np.array(getattr(message, field)) for field in fields]
        writer = JointStateWriter(message.name, fields, message.header.frame_id)
        written = writer.write(stamp, *arrays)
        assert len(written) == len(found.fixed)
        assert has(found, written)
        assert written[4:12] == raw[4:12]
        assert numbers(found, written, message) == numbers(found, raw, message)


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


def test_c_knows_what_came_once_of_several_publishers_in_any_order_of_joints(
    reader: Readers, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, long_ways = reader(extra=True), list[bytes]()
    monkeypatch.setattr(reading, "parsed", lambda raw: long_ways.append(raw) or parsed(raw))
    orders = [NAMES, NAMES[::-1], [NAMES[1], NAMES[2], NAMES[0]], ["hand", *NAMES]]
    for k in range(5):
        for names in orders:
            position = [float(k + len(name)) for name in names]
            velocity = [-x for x in position]
            message = JointState(name=names, position=position, velocity=velocity)
            wanted = tuple(float(k + len(name)) for name in NAMES)
            values = read.read(serialize_message(message))[1]
            assert values == [wanted, tuple(-x for x in wanted)]
    assert len(long_ways) == len(orders)


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


def test_beside_extra_joints_the_number_that_is_not_finite_is_named() -> None:
    arm = models.dynamics("gripper").model.joint_names
    message = JointState(name=[*arm, "lamp"], position=[0.0] * (len(arm) + 1))
    message.velocity = [np.nan, *[0.0] * len(arm)]
    reader = JointStateReader(Expected(arm, ("position", "velocity"), extra=True))
    with pytest.raises(InvalidInput, match=f"velocity of joint '{arm[0]}' is nan"):
        reader.read(serialize_message(message))


ORDER = ("effort", "position", "velocity")
FOLLOWERS = {
    "agreeing": ({"position": [0.03, -0.011, 0.2]}, ""),
    "within rounding": ({"position": [0.03, -0.0115, 0.2]}, ""),
    "of all fields": (
        {"position": [0.03, -0.011, 0.2], "velocity": [0.1, -0.07, 0], "effort": [5.0, 0, 1]}, ""
    ),
    "without a number": ({"position": [0.03, float("nan"), 0.2]}, ""),
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


def test_a_mimic_joint_alone_is_told_to_follow() -> None:
    arm = models.dynamics("gripper").model.joint_names
    reader = JointStateReader(Expected(arm, ("effort",), partial=True))
    raw = serialize_message(JointState(name=["swing", "right_slide"], effort=[1.0, 0.0]))
    with pytest.raises(InvalidInput, match="^right_slide follows left_slide; command that one$"):
        reader.read(raw)


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
        (state(position=[1.0], velocity=[1.0]), "position has 1 numbers for 3 joints"),
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


@pytest.mark.parametrize(
    "bits",
    [
        0x7FF0000000000000, 0xFFF0000000000000,  # infinities
        0x7FF8000000000000, 0xFFF8000000000000, 0x7FF0000000000001, 0x7FFFFFFFFFFFFFFF,  # NaNs
    ],
    ids=hex,
)  # fmt: skip
@pytest.mark.parametrize("place", range(6))
def test_no_number_that_is_not_finite_gets_past_a_layout_that_is_known(
    bits: int, place: int, reader: Readers
) -> None:
    read, good = reader(), np.arange(6.0)
    for _ in range(3):  # C knows what came twice
        read.read(serialize_message(state(position=good[:3].tolist(), velocity=good[3:].tolist())))
    bad = good.copy()
    bad.view(np.uint64)[place] = bits
    with pytest.raises(InvalidInput, match="allowed: finite numbers"):
        read.read(serialize_message(state(position=bad[:3].tolist(), velocity=bad[3:].tolist())))


def test_refused_numbers_are_not_kept(reader: Readers) -> None:
    read = reader(partial=True)
    with pytest.raises(InvalidInput):
        read.read(serialize_message(state(position=[np.nan] * 3, velocity=[5.0] * 3)))
    part = JointState(name=NAMES[:1], position=[1.0], velocity=[1.0])
    np.testing.assert_array_equal(read.read(serialize_message(part))[1], [[1, 0, 0], [1, 0, 0]])


def test_rubbish_is_refused(rng: np.random.Generator, reader: Readers) -> None:
    good = serialize_message(state(position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0, 6.0]))
    for length in (0, 1, 3, 4, 11, 30, 60):
        with pytest.raises(InvalidInput, match="are not a JointState"):
            reader().read(good[:length])


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
