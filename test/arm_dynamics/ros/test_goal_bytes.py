# SPDX-License-Identifier: Apache-2.0
"""Trajectories and paths as bytes, against the generated serializer and deserializer."""

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from byte_order import sent
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics import InvalidInput
from arm_dynamics.cdr import CdrWriter
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.controller.messages import PathBytes, TrajectoryBytes
from arm_dynamics.ros.interfaces import MAX_GOAL_POINTS

pytestmark = pytest.mark.ros

bounded = settings(max_examples=30, deadline=None, derandomize=True)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
numbers = st.floats(width=64)
arrays = st.lists(numbers, max_size=4)
since = {"sec": st.integers(-(2**31), 2**31 - 1), "nanosec": st.integers(0, 2**32 - 1)}
headers = st.builds(Header, stamp=st.builds(Time, **since), frame_id=texts)
points = st.builds(
    JointTrajectoryPoint, positions=arrays, velocities=arrays, accelerations=arrays,
    effort=arrays, time_from_start=st.builds(Duration, **since),
)  # fmt: skip
trajectories = st.builds(
    JointTrajectory, header=headers, joint_names=st.lists(texts, max_size=4),
    points=st.lists(points, max_size=5),
)  # fmt: skip
poses = st.builds(
    Pose, position=st.builds(Point, x=numbers, y=numbers, z=numbers),
    orientation=st.builds(Quaternion, x=numbers, y=numbers, z=numbers, w=numbers),
)  # fmt: skip
paths = st.builds(
    Path, header=headers,
    poses=st.lists(st.builds(PoseStamped, header=headers, pose=poses), max_size=4),
)  # fmt: skip
orders = st.sampled_from("<>")
MANY = 50
FIELDS = ("positions", "velocities", "accelerations", "effort")


def check_trajectory(raw: bytes, message: JointTrajectory) -> None:
    """What is read is what the message says, to the bit."""
    found = TrajectoryBytes(raw, MANY)
    assert found.stamp == to_nanoseconds(message.header.stamp)
    assert list(found.joint_names) == list(message.joint_names)
    assert found.count == len(message.points)
    for _ in range(2):  # a plan that came too late reads again
        for (time, *arrays), wanted in zip(found.points(), message.points, strict=True):
            assert time == to_nanoseconds(wanted.time_from_start)
            for field, read in zip(FIELDS, arrays, strict=True):
                assert np.array(read, float).tobytes() == getattr(wanted, field).tobytes()


def check_path(raw: bytes, message: Path) -> None:
    found = PathBytes(raw)
    assert found.frame_id == message.header.frame_id
    assert found.count == len(message.poses)
    for (frame_id, pose), wanted in zip(found.poses(), message.poses, strict=True):
        at, turn = wanted.pose.position, wanted.pose.orientation
        assert frame_id == wanted.header.frame_id
        seven = np.array((at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w))
        assert np.array(pose, float).tobytes() == seven.tobytes()


@bounded
@given(trajectories, orders)
def test_a_trajectory_is_read_as_the_generated_deserializer_reads_it(
    message: JointTrajectory, order: str
) -> None:
    raw = serialize_message(message)
    check_trajectory(raw, deserialize_message(raw, JointTrajectory))
    check_trajectory(sent(message, order), message)


@bounded
@given(paths, orders)
def test_a_path_is_read_as_the_generated_deserializer_reads_it(message: Path, order: str) -> None:
    raw = serialize_message(message)
    check_path(raw, deserialize_message(raw, Path))
    check_path(sent(message, order), message)


def whole(raw: bytes) -> int:
    """Read everything there is; returns how many points."""
    message = TrajectoryBytes(raw, MANY)
    return len(list(message.points()))


def whole_path(raw: bytes) -> int:
    return len(list(PathBytes(raw).poses()))


def sample() -> JointTrajectory:
    message = JointTrajectory(joint_names=["base", "elbow"])
    for k in range(3):
        point = JointTrajectoryPoint(positions=[0.1 * k, 0.2], velocities=[1.0, 2.0])
        point.time_from_start.sec = k + 1
        message.points.append(point)
    return message


def sample_path() -> Path:
    return Path(poses=[PoseStamped() for _ in range(3)])


SAMPLES = [
    (sent(sample(), "<"), whole), (sent(sample(), ">"), whole),
    (sent(sample_path(), "<"), whole_path), (sent(sample_path(), ">"), whole_path),
]  # fmt: skip


@pytest.mark.parametrize(("raw", "read"), SAMPLES)
def test_a_message_that_is_cut_off_anywhere_is_refused(
    raw: bytes, read: Callable[[bytes], int]
) -> None:
    assert read(raw) == 3
    for length in range(len(raw)):
        with pytest.raises(InvalidInput, match="ends too early|begins with"):
            read(raw[:length])


@pytest.mark.parametrize(("raw", "read"), SAMPLES)
def test_lengths_that_are_not_there_are_refused_and_nothing_is_made_for_them(
    raw: bytes, read: Callable[[bytes], int]
) -> None:
    """Every place is written over by great numbers; most of them are lengths somewhere."""
    tracemalloc.start()
    try:
        for at in range(0, len(raw) - 4):
            for value in (b"\xff\xff\xff\xff", b"\x00\x00\x00\x7f", b"\x7f\x00\x00\x00"):
                damaged = raw[:at] + value + raw[at + 4 :]
                tracemalloc.reset_peak()
                before = tracemalloc.get_traced_memory()[0]
                try:
                    assert read(damaged) <= MAX_GOAL_POINTS
                except InvalidInput as refusal:
                    assert len(str(refusal)) < 200
                assert tracemalloc.get_traced_memory()[1] - before < 50_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("begin", [b"\0\x07\0\0", b"\1\0\0\0"])
def test_other_encodings_are_refused(begin: bytes) -> None:
    with pytest.raises(InvalidInput, match="allowed: CDR version 1"):
        whole(begin + sent(sample())[4:])


def head(names: int = 1, points: int = 0, name: str = "base") -> bytes:
    """A trajectory that ends where its points would begin."""
    writer = CdrWriter()
    writer.time(0)
    writer.text("")
    writer.texts([name] * names)
    writer.count(points)
    return bytes(writer.raw)


def test_limits_are_said_before_anything_is_read() -> None:
    most = MAX_GOAL_POINTS
    assert TrajectoryBytes(head(points=most), 1).count == most
    with pytest.raises(InvalidInput, match=f"{most + 1} points; allowed: up to {most}"):
        TrajectoryBytes(head(points=most + 1), 1)
    with pytest.raises(InvalidInput, match="4 joint names; allowed: up to 3"):
        TrajectoryBytes(head(names=4), 3)
    with pytest.raises(InvalidInput, match="2001 bytes of a name; allowed: up to 1000"):
        TrajectoryBytes(head(name="x" * 2000), 1)
    with pytest.raises(InvalidInput, match=f"{most + 1} poses; allowed: up to {most}"):
        PathBytes(head(names=most + 1, name=""))
