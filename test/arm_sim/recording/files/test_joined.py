# SPDX-License-Identifier: Apache-2.0
"""Joints that different messages of a topic name, as those of several drivers, are joined."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from mcap.writer import Writer

from arm_dynamics import InvalidInput
from arm_sim import Recording
from arm_sim.recording.files.messages import JOINT_STATE, definition, joint_state_layout, written

START = 1_760_000_000_000_000_000
MS = 1_000_000


class Message(NamedTuple):
    """A joint state that moves at one rad/s, with times in [ms] from the start."""

    names: Sequence[str]
    time: float
    late: float = 0.1
    stamped: bool = True
    topic: str = "/joint_states"
    moves: bool = True

    def raw(self) -> bytes:
        stamp = START + round(MS * self.time) if self.stamped else 0
        if not self.moves:
            return written(JOINT_STATE, stamp=stamp, name=self.names, effort=np.ones(1))
        numbers = 1e-3 * self.time + 10.0 * np.array([ord(name[0]) for name in self.names])
        (raw,) = joint_state_layout(self.names).written(
            np.array([stamp]), position=numbers, velocity=numbers + 1.0, effort=numbers + 2.0
        )
        return raw


def loaded(path: Path, messages: Iterable[Message]) -> Recording:
    writer, channels = Writer(str(path)), dict[str, int]()
    writer.start("ros2")
    schema = writer.register_schema(JOINT_STATE, "ros2msg", definition(JOINT_STATE).encode())
    for message in sorted(messages, key=lambda m: m.time + m.late):
        if message.topic not in channels:
            channels[message.topic] = writer.register_channel(message.topic, "cdr", schema)
        log = START + round(MS * (message.time + message.late))
        writer.add_message(channels[message.topic], log, message.raw(), log)
    writer.finish()
    return Recording.load(path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "bag.mcap"


def notes(run: Recording) -> list[str]:
    return [event.text.removeprefix("file: ") for event in run.events]


def check(run: Recording, known: dict[str, slice]) -> None:
    """Values of each joint are those at the recording's times, and known where said."""
    assert run.joint_names == tuple(known)
    for j, (name, rows) in enumerate(known.items()):
        for part, add in ((run.q, 0.0), (run.v, 1.0), (run.tau, 2.0)):
            there = np.zeros(len(run), bool)
            there[rows] = True
            np.testing.assert_array_equal(np.isfinite(part[:, j]), there)
            start = 10.0 * ord(name[0]) + add
            np.testing.assert_allclose(part[there, j] - start, run.time[there], atol=1e-9)


def test_a_message_for_each_joint(path: Path) -> None:
    run = loaded(
        path, [Message([n], 5 * k + 0.5 * i) for k in range(40) for i, n in enumerate("abc")]
    )
    check(run, {"a": slice(0, 40), "b": slice(1, 40), "c": slice(1, 40)})
    np.testing.assert_allclose(np.diff(run.time), 5e-3, atol=1e-12)
    assert notes(run) == [
        "b: from 40 messages of their own, interpolated to the times of a",
        "c: from 40 messages of their own, interpolated to the times of a, b",
    ]


def test_joints_are_taken_from_most_messages_that_name_them(path: Path) -> None:
    """A node publishes joints of the driver once more, merged, later, less often, with a pause.

    No value is made up in the pause, nor beyond the last message.
    """
    driver = [Message("ba" if k % 2 else "ab", 2 * k) for k in range(100)]
    merged = [Message("abc", 20 * k + 1) for k in range(9) if k not in (3, 4, 5, 6)]
    again = [Message("b", 50 * k + 0.3) for k in range(3)]
    run = loaded(path, [*driver, *merged, *again])
    known = np.r_[1:21, 71:81]
    check(run, {"a": slice(None), "b": slice(None), "c": known})  # type: ignore[dict-item]
    assert notes(run)[0] == "3 messages name no further joint than others"


@pytest.mark.parametrize(
    ("gripper", "told"),
    [
        ([Message("g", 2 * k, late=0.0, stamped=False) for k in range(100)], "g: stamps do not"),
        (
            [Message("g", 2 * k - 3000, late=3000.1) for k in range(100)],
            "clocks of joints are 3 s",
        ),
        ([Message("g", k - k % 2, late=0.0) for k in range(100)], "50 messages have the time of"),
    ],
    ids=["without stamps", "on a computer whose clock is behind", "sent twice"],
)
def test_other_clocks_are_told(gripper: list[Message], told: str, path: Path) -> None:
    run = loaded(path, [*(Message("a", 2 * k, late=0.0) for k in range(100)), *gripper])
    assert any(note.startswith(told) for note in notes(run)), notes(run)


def test_of_several_topics_the_one_that_is_read_is_told(
    path: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    left = [Message("a", 2 * k, topic="/left/joint_states") for k in range(30)]
    right = [Message("b", 2 * k, topic="/right/joint_states") for k in range(20)]
    run = loaded(path, [*left, *right])
    check(run, {"a": slice(None)})
    assert notes(run) == [
        "joint states are those of /left/joint_states; also recorded: /right/joint_states"
    ]
    run.save(tmp_path / "left.csv")
    assert "/right/joint_states (./arm record --repair copies a file whole)" in caplog.text


def test_the_topic_with_positions_is_read_although_commands_are_more(path: Path) -> None:
    commands = [Message("a", k, topic="/joint_commands", moves=False) for k in range(30)]
    wanted = [Message("a", k, topic="/a/desired") for k in range(40)]
    states = [Message("a", 2 * k) for k in range(20)]
    check(loaded(path, [*commands, *states]), {"a": slice(None)})
    assert len(loaded(path, [*commands, *wanted, *states])) == len(states)
    assert notes(loaded(path, commands)) == ["the messages on /joint_commands have no positions"]
    with pytest.raises(InvalidInput, match="the joint states name no joints"):
        loaded(path, [Message("", k) for k in range(3)])
