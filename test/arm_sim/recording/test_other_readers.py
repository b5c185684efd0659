# SPDX-License-Identifier: Apache-2.0
"""Our recordings read by other software: ``rosbags``, and the decoder of ``mcap`` for ROS 2."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import models
from arm_sim import Recording

STATES, TICKS = "/joint_states", "/sim/ticks"


@pytest.fixture(scope="module")
def run() -> Recording:
    return models.simulator("two_link").run(0.05, [0.3, -0.1])


def check(run: Recording, states: list[Any], ticks: list[Any], stamps: list[int]) -> None:
    """A joint state for each row, a tick for each but the first, with their times."""
    np.testing.assert_array_equal([message.position for message in states], run.q)
    np.testing.assert_array_equal([message.velocity for message in states], run.v)
    assert {tuple(message.name) for message in states} == {tuple(run.joint_names)}
    np.testing.assert_array_equal([tick.state for tick in ticks], np.hstack([run.q, run.v])[1:])
    np.testing.assert_array_equal([tick.command for tick in ticks], run.command[1:])
    own = [tick.header.stamp.sec * 10**9 + tick.header.stamp.nanosec for tick in ticks]
    assert own == stamps == [10**6 * k for k in range(1, len(run))]


def test_rosbags_reads_a_bag_by_the_types_in_it(run: Recording, tmp_path: Path) -> None:
    folder = run.save(tmp_path / "bag")
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([folder], default_typestore=store) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        found: dict[str, list[Any]] = {topic: [] for topic in kinds}
        for connection, stamp, raw in reader.messages():
            found[connection.topic].append((stamp, reader.deserialize(raw, connection.msgtype)))
    assert (kinds[STATES], kinds[TICKS]) == ("sensor_msgs/msg/JointState", "arm_msgs/msg/Tick")
    stamps, ticks = zip(*found[TICKS], strict=True)
    check(run, [message for _, message in found[STATES]], list(ticks), list(stamps))


def test_the_decoder_of_mcap_reads_every_message(run: Recording, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.mcap")
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    stamps, ticks = zip(*found[TICKS], strict=True)
    check(run, [message for _, message in found[STATES]], list(ticks), list(stamps))
