# SPDX-License-Identifier: Apache-2.0
"""Other software opens our files, also those that were cut off and repaired."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import models
from arm_dynamics import InvalidInput
from arm_sim import Recording
from arm_sim.cli.main import main
from arm_sim.recording.files.repair import repair


def content(path: Path) -> tuple[Any, ...]:
    """All that a file contains, as the library ``mcap`` finds it by the index."""
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        schemas = {s.id: (s.name, s.encoding, s.data) for s in summary.schemas.values()}
        topics = {
            c.topic: (c.message_encoding, c.metadata, schemas.get(c.schema_id))
            for c in summary.channels.values()
        }
        messages = [
            (c.topic, m.log_time, m.publish_time, m.sequence, m.data)
            for _, c, m in reader.iter_messages()
        ]
        assert summary.statistics.message_count == len(messages)
        attached = [(a.name, a.media_type, a.log_time, a.data) for a in reader.iter_attachments()]
        facts = {m.name: m.metadata for m in reader.iter_metadata() if m.name != "repaired"}
        return reader.get_header(), topics, attached, facts, messages


def by_rosbags(path: Path) -> dict[str, list[Any]]:
    """Messages of each topic."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        found: dict[str, list[Any]] = {connection.topic: [] for connection in reader.connections}
        for connection, _, raw in reader.messages():
            found[connection.topic].append(reader.deserialize(raw, connection.msgtype))
    return found


def by_mcap(path: Path) -> dict[str, list[Any]]:
    """Likewise, of one file, by the decoder of ``mcap`` for ROS 2."""
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, _, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(decoded)
    return found


@pytest.mark.parametrize(("name", "read"), [("bag", by_rosbags), ("run.mcap", by_mcap)])
def test_other_software_reads_a_recording(name: str, read: Any, tmp_path: Path) -> None:
    """A joint state for each row, a tick for each but the first, with their times."""
    run = models.simulator("two_link").run(0.05, [0.3, -0.1])
    found = read(run.save(tmp_path / name))
    states, ticks = found["/joint_states"], found["/sim/ticks"]
    assert {tuple(message.name) for message in states} == {run.joint_names}
    np.testing.assert_array_equal([message.position for message in states], run.q)
    np.testing.assert_array_equal([message.velocity for message in states], run.v)
    np.testing.assert_array_equal([tick.state for tick in ticks], np.hstack([run.q, run.v])[1:])
    np.testing.assert_array_equal([tick.command for tick in ticks], run.command[1:])
    stamps = [tick.header.stamp for tick in ticks]
    assert [10**9 * x.sec + x.nanosec for x in stamps] == [10**6 * k for k in range(1, len(run))]


def test_wherever_it_is_cut_off_it_opens_with_all_that_was_whole(tmp_path: Path) -> None:
    """By the command of the page, with topics that have no message."""
    run = models.simulator("two_link").run(2.0, [0.3, -0.1])
    raw = run.save(tmp_path / "whole.mcap").read_bytes()
    header, topics, attached, facts, messages = content(tmp_path / "whole.mcap")
    cut, out, counts = tmp_path / "cut.mcap", tmp_path / "out.mcap", set()
    first = raw.index(b"zstd", raw.index(b"zstd") + 1)  # the first chunk introduces the topics
    for size in np.linspace(first, len(raw) - 1, 4).astype(int).tolist():
        cut.write_bytes(raw[:size])
        done = CliRunner().invoke(main, ["record", "--repair", str(cut), "--out", str(out)])
        assert done.exit_code == 0, done.output
        mine = content(out)
        assert mine[:4] == (header, topics, attached, facts)
        last = max((log for _, log, *_ in mine[4]), default=-1)
        assert sorted(mine[4]) == sorted(m for m in messages if m[1] <= last)
        count = {topic: len(found) for topic, found in by_rosbags(out).items()}
        assert all(f"{n:9d}  {topic}\n" in done.output for topic, n in count.items())
        counts.add(sum(count.values()))
        out.unlink()
    assert len(counts) >= 3, "chunks are kept one by one"


def of_others(path: Path, **options: Any) -> None:
    """Types that are not installed, other encodings, quality of service, files, metadata."""
    with path.open("wb") as sink:
        writer = Writer(sink, chunk_size=4000, **options)
        writer.start("ros2", "somebody")
        image = writer.register_schema("a_msgs/msg/Image", "ros2msg", b"uint8[] data")
        qos = {"offered_qos_profiles": "- durability: 1", "topic_type_hash": "RIHS01_0"}
        channels = [
            writer.register_channel("/camera", "cdr", image, qos),
            writer.register_channel("/telemetry", "json", 0),
            writer.register_channel("/silent", "cdr", image),
        ]
        for k in range(600):
            writer.add_message(channels[k % 2], k, b"{%d}" % k * 9, k + 1, k)
        writer.add_attachment(5, 6, "calibration.bin", "application/x", bytes(range(256)))
        writer.add_metadata("robot", {"serial": "0815"})
        writer.finish()


@pytest.mark.parametrize(
    "options", [{"compression": CompressionType.LZ4}, {"use_chunking": False}]
)
def test_files_of_others_are_copied_whole(options: dict[str, Any], tmp_path: Path) -> None:
    path, out = tmp_path / "whole.mcap", tmp_path / "out.mcap"
    of_others(path, **options)
    assert repair(path, out).damage == []
    assert content(out) == content(path)
    raw, (cut, some) = path.read_bytes(), (tmp_path / "cut.mcap", tmp_path / "some.mcap")
    cut.write_bytes(raw[: len(raw) // 3])
    (told,) = repair(cut, some).damage
    assert "truncated" in told and content(some)[:2] == content(path)[:2]
    messages = content(some)[4]
    assert 60 < len(messages) < 400 and messages == content(path)[4][: len(messages)]


def test_the_files_of_a_bag_become_one(tmp_path: Path) -> None:
    """Each numbers its topics by itself and has the scene; a damaged part is told and left out."""
    runs = [models.simulator("two_link").run(t) for t in (0.5, 0.6)]
    folder = tmp_path / "bag"
    folder.mkdir()
    for k, run in enumerate(runs):
        run.save(folder / f"bag_{k}.mcap")
    second = bytearray((folder / "bag_1.mcap").read_bytes())
    second[second.index(b"zstd") + 40] ^= 0xFF
    (folder / "bag_1.mcap").write_bytes(second)
    found = repair(folder, tmp_path / "one.mcap")
    attached = [name for name, *_ in content(tmp_path / "one.mcap")[2]]
    assert sorted(attached) == ["robot.urdf", "scene.yaml"]
    assert len(found.damage) == 1 and "is damaged" in found.damage[0]
    count = {topic: len(told) for topic, told in by_rosbags(tmp_path / "one.mcap").items()}
    assert count == found.count and count["/sim/ticks"] == 1100


@pytest.mark.parametrize(("cut", "out", "said"), [
    ("cut.mcap", "old.mcap", "'old.mcap' exists, and another recorder may"),
    ("cut.mcap", "new.db3", "only .mcap is repaired, into .mcap"),
    ("cut.db3", "new.mcap", "ros2 bag reindex writes its metadata.yaml"),
    ("cut.mcap", "new.mcap", "'cut.mcap' contains nothing that can be repaired"),
    ("text.mcap", "new.mcap", "'text.mcap' is not an MCAP file"),
])  # fmt: skip
def test_what_is_not_repaired_leaves_nothing_behind(
    cut: str, out: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files = {"cut.mcap": MCAP0_MAGIC, "old.mcap": b"", "cut.db3": b"", "text.mcap": b"x"}
    for name, raw in files.items():
        Path(name).write_bytes(raw)
    with pytest.raises(InvalidInput, match=said):
        repair(Path(cut), Path(out))
    assert len(list(tmp_path.iterdir())) == 4


def test_what_saving_leaves_of_a_bag_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    models.simulator("two_link").run(0.05).save(folder / "bag_0.mcap")
    of_others(folder / "bag_1.mcap")
    loaded = Recording.load(folder)
    assert len(loaded) == 51 and loaded.left == ("/camera", "/telemetry")
    loaded.save(tmp_path / "run.mcap")
    assert "in the recording's file: /camera, /telemetry (./arm record --repair" in caplog.text
    caplog.clear()
    Recording.load(tmp_path / "run.mcap").save(tmp_path / "again.mcap")
    assert not caplog.text
