# SPDX-License-Identifier: Apache-2.0
"""A recording loaded from a file equals the original, on any machine; others are refused."""

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import models
from arm_dynamics import InvalidInput, SceneError
from arm_dynamics.exceptions import NotWritten
from arm_sim import Recording, Simulator, State
from arm_sim.recording.files.messages import JOINT_STATE, LOG, joint_state_layout
from arm_sim.recording.files.reader import read_bag
from arm_sim.recording.files.writer import new_file, place_of
from arm_sim.simulation.runtime_changes import external_change

ROWS = ("time", "q", "v", "z", "command", "local_error", "time_stepped", "p")
KINDS = ("run.mcap", "run")
ARCHIVES = Path(__file__).with_name("archives")  # written before, when recordings were saved so


@pytest.fixture(scope="module")
def recording() -> Recording:
    """An arm that is pushed, moved and tuned while it runs.

    The plane's normal would not stay to the last bit, if it was made of length one once more.
    """
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    plane = {"frame": "world", "point": [0.0, 0.0, -9.0], "normal": [0.1, 0.2, 0.7]}
    scene["constraints"] = [{"type": "contact", "frame": "tip", "plane": plane}]
    scene |= {"joints": {"*": {"friction": {"coulomb": 0.05}}}, "tunable": ["gravity"]}
    sim = Simulator(scene, dt=2e-3)

    def control(state: State) -> np.ndarray:
        if state.step == 10:
            sim.set_parameter("gravity", [0.0, 0.0, -1.62])
        if state.step == 20:
            sim.set_state([0.3, -0.2], [0.1, 0.0])
        if state.step == 30:
            external_change(sim)()
        if 30 <= state.step < 40:
            sim.set_parameter("external", [0.1 * state.step, -0.3])
        return np.sin([state.time, 3.0 * state.time])

    return sim.run(0.1, control)


@pytest.mark.parametrize("name", KINDS)
def test_a_file_answers_as_the_original(name: str, recording: Recording, tmp_path: Path) -> None:
    loaded = Recording.load(recording.save(tmp_path / name))
    again = Recording.load(loaded.save(tmp_path / ("again" + Path(name).suffix)))
    for part in ROWS:
        mine = getattr(recording, part)
        for theirs in (getattr(loaded, part), getattr(again, part)):
            assert mine.shape == theirs.shape and mine.tobytes() == theirs.tobytes(), part
    assert [jump.row for jump in again.jumps] == [jump.row for jump in loaded.jumps]
    assert loaded.joint_names == recording.joint_names
    assert loaded.scene == recording.scene
    for answer in ("tau", "energy", "supplied", "lost", "changed", "balance"):
        np.testing.assert_array_equal(getattr(loaded, answer), getattr(recording, answer))
    assert loaded.energy_error == recording.energy_error


def test_changes_come_back_with_the_step_of_error_control_at_each(tmp_path: Path) -> None:
    sim = Simulator("two_link", dt=0.05, tolerance=1e-9)

    def control(state: State) -> np.ndarray:
        if state.step in (2, 7):
            sim.set_state(v=[-1.0, state.step])
        return np.zeros(2)

    run = sim.run(0.5, control)
    loaded = Recording.load(run.save(tmp_path / "run.mcap"))
    assert [jump.row for jump in loaded.jumps] == [2, 7]
    assert len({run.substep, *(jump.substep for jump in run.jumps)}) == 3
    assert loaded.substep == run.substep
    for jump, original in zip(loaded.jumps, run.jumps, strict=True):
        assert (jump.tunable, jump.substep) == (original.tunable, original.substep)
        np.testing.assert_array_equal(jump.x, original.x)
        np.testing.assert_array_equal(jump.p, original.p)


def test_laws_with_states_and_constraints_come_back(tmp_path: Path) -> None:
    for name in ("flexible_arm", "slider_crank"):
        run = Simulator(name).run(0.02)
        loaded = Recording.load(run.save(tmp_path / f"{name}.mcap"))
        assert loaded.held == run.held
        for part in ("z", "tau", "multipliers") if run.held else ("z", "tau"):
            np.testing.assert_array_equal(getattr(loaded, part), getattr(run, part))


def test_what_sensors_told_comes_back_but_at_gaps(tmp_path: Path) -> None:
    scene = models.scene("two_link").model_dump(exclude_unset=True)
    sensors = {"position": {"resolution": 1e-3}, "velocity": {"noise": 0.1}}
    run = Simulator(scene | {"sensors": sensors}).run(0.02, lambda state: [0.1, -state.v[1]])
    assert run.measured is not None
    time = np.where(np.arange(21) < 7, run.time, run.time + 0.05)
    hold = np.array([0, 1, 1, 2, *[0] * 17], np.uint8)
    made = replace(run, time=time, gaps=(7,), hold=hold)
    once = Recording.load(made.save(tmp_path / "once.mcap"))
    loaded = Recording.load(once.save(tmp_path / "twice.mcap"))
    assert loaded.gaps == (7,) and loaded.measured is not None
    np.testing.assert_array_equal(loaded.hold, hold)
    np.testing.assert_array_equal(loaded.part([5, 2]).measured.v, loaded.measured.v[[5, 2]])
    for part in ("q", "v", "effort"):
        expected = getattr(run.measured, part).copy()
        expected[7] = np.nan
        np.testing.assert_array_equal(getattr(loaded.measured, part), expected)


def test_a_file_is_read_up_to_where_it_breaks_off_and_after_damage(tmp_path: Path) -> None:
    run = Simulator(models.SCENES / "two_link.yaml").run(2.0)
    whole = run.save(tmp_path / "run.mcap").read_bytes()
    cut, seen = tmp_path / "cut.mcap", set()
    for size in np.linspace(len(whole) // 2, len(whole) - 1, 5).astype(int).tolist():
        cut.write_bytes(whole[:size])
        loaded = Recording.load(cut)
        k = len(loaded)
        seen.add(k)
        assert loaded.q.tobytes() == run.q[:k].tobytes()
        assert any("truncated" in event.text for event in loaded.events) or k == len(run)
    assert len(seen) >= 3, "chunks are kept one by one"
    with (tmp_path / "run.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    raw = bytearray(whole)
    raw[summary.chunk_indexes[2].chunk_start_offset + 100] ^= 0xFF
    cut.write_bytes(raw)
    damaged = Recording.load(cut)
    (gap,) = damaged.gaps
    assert damaged.time[gap] - damaged.time[gap - 1] > 0.4
    np.testing.assert_array_equal(damaged.q[gap:], run.q[-(len(damaged) - gap) :])
    assert any("damaged" in event.text for event in damaged.events)
    assert "gap" in repr(damaged) and damaged.energy_error < 1e-6


@pytest.mark.parametrize(("name", "content", "said"), [
    ("run.npz", b"PK\x03\x04 no archive", "damaged"),
    ("run.mcap", b"\x89MCAP0\r\n", "no joint states"),
    ("run.db3", b"SQLite format 3\0 but not really", "damaged"),
])  # fmt: skip
def test_what_is_no_recording_is_refused(
    name: str, content: bytes, said: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput, match=said):
        Recording.load(tmp_path / name)


def test_an_archive_of_before_is_read_and_converted(tmp_path: Path) -> None:
    run = Recording.load(ARCHIVES / "simulated.npz")
    again = Recording.load(run.save(tmp_path / "run.mcap"))
    assert run.scene is not None and run.scene.sensors is not None and run.scene == again.scene
    assert [jump.row for jump in run.jumps] == [jump.row for jump in again.jumps] == [5, 10, 15]
    assert run.hold is not None and run.hold[:4].tolist() == [0, 1, 1, 2]
    np.testing.assert_array_equal(again.measured.v, run.measured.v)
    for part in (*ROWS, "hold", "balance"):
        np.testing.assert_array_equal(getattr(again, part), getattr(run, part))
    of_robot = Recording.load(ARCHIVES / "robot.npz")
    assert of_robot.events[0].text == "file: said by the driver"
    np.testing.assert_array_equal(of_robot.q[:, 0], np.cos(0.02 * np.arange(10)))
    for rows, said in ((np.zeros((21, 3)), "2 columns are exp"), (np.zeros((7, 2)), "equal numb")):
        with np.load(ARCHIVES / "simulated.npz") as archive:
            np.savez(tmp_path / "wrong.npz", **{**archive, "v": rows})
        with pytest.raises(InvalidInput, match=said):
            Recording.load(tmp_path / "wrong.npz")


@pytest.mark.parametrize("name", KINDS)
def test_saving_says_what_it_replaces_and_what_it_cannot_write(
    name: str, recording: Recording, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    recording.save(tmp_path / name)
    recording.save(tmp_path / name)
    assert [message.endswith("existed and is replaced") for message in caplog.messages] == [True]
    with pytest.raises(NotWritten, match=f"^'/proc/{name}' cannot be"):
        recording.save(f"/proc/{name}")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(InvalidInput, match=r"thesis\.tex"):
        recording.save(tmp_path / "mine")
    with pytest.raises(FileNotFoundError, match="there is no folder '.*nowhere'"):
        place_of(tmp_path / "nowhere" / "run.mcap")  # for nodes, before anything is recorded


# --- of robots ----------------------------------------------------------------------------------


@pytest.fixture
def robot_bag(tmp_path: Path) -> Path:
    """A bag of ROS 2 as rosbag2_storage_sqlite3 writes it, without its metadata file."""
    path, t = tmp_path / "robot.db3", 0.02 * np.arange(50)
    names, tool = ("tool", "elbow", "shoulder"), np.full(50, 9.0)
    messages = joint_state_layout(names).written(
        100 * 10**9 + 20_000_000 * np.arange(50),
        position=np.column_stack([tool, np.cos(t), np.sin(t)]),
        velocity=np.column_stack([tool, -np.sin(t), np.cos(t)]),
        effort=np.column_stack([tool, t, 2 * t]),
    )
    with closing(sqlite3.connect(path)) as base, base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, format)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        topics = (1, "/joint_states", JOINT_STATE, ""), (2, "/rosout", LOG, "")
        base.executemany("INSERT INTO topics VALUES(?, ?, ?, ?)", topics)
        entries = [(k + 1, 1, 7 + k, message) for k, message in enumerate(messages)]
        entries.append((99, 1, 99, b"\0\1\0\0 cut"))
        base.executemany("INSERT INTO messages VALUES(?, ?, ?, ?)", entries)
    return path


def test_a_bag_of_a_robot_is_a_recording(robot_bag: Path, tmp_path: Path) -> None:
    """It is kept as a table."""
    run = Recording.load(robot_bag)
    assert run.of_robot and run.scene is None and len(run) == 50
    np.testing.assert_allclose(run.time, 0.02 * np.arange(50), atol=1e-12)
    np.testing.assert_array_equal(run.q[:, 1], np.cos(0.02 * np.arange(50)))
    assert "could not be read" in run.events[0].text
    with pytest.raises(InvalidInput, match="scene="):
        run.energy  # noqa: B018 - asking is what is refused
    with pytest.raises(InvalidInput, match="rosout"):
        Recording.load(robot_bag, topic="/wheels")
    with pytest.raises(InvalidInput, match=r"only joint states are known; allowed: \.csv"):
        run.save(tmp_path / "robot.mcap")
    again = Recording.load(run.save(tmp_path / "robot.csv"))
    assert again.of_robot and again.joint_names == run.joint_names
    for part in ("time", "q", "v", "command"):
        np.testing.assert_array_equal(getattr(again, part), getattr(run, part))


def test_a_damaged_bag_is_read_up_to_the_damage(robot_bag: Path) -> None:
    """It is refused if no message can be read."""
    with closing(sqlite3.connect(robot_bag)) as base, base:
        base.execute("CREATE INDEX timestamp_idx ON messages (timestamp)")  # as rosbag2 does
    whole = robot_bag.read_bytes()
    raw = bytearray(whole)
    place = raw.index(np.cos(0.02 * 40).tobytes())
    page = place // 4096 * 4096
    raw[page : page + 4096] = bytes(4096)
    robot_bag.write_bytes(raw)
    run = Recording.load(robot_bag)
    assert 0 < len(run) < 50 and "damaged from message" in run.events[0].text
    robot_bag.write_bytes(whole)
    with closing(sqlite3.connect(robot_bag)) as base, base:
        base.execute("DELETE FROM messages WHERE id < 99")
    with pytest.raises(InvalidInput, match="no message on '/joint_states' that can be read"):
        Recording.load(robot_bag)


def test_with_a_scene_it_has_energies(robot_bag: Path) -> None:
    run = Recording.load(robot_bag, models.scene("two_link"))
    dynamics = models.dynamics("two_link")
    assert run.joint_names == dynamics.joint_names and run.left == ("tool",)
    np.testing.assert_array_equal(run.kinetic, dynamics.energy(run.q, run.v)[0])
    np.testing.assert_array_equal(run.tau[:, 0], 2 * (0.02 * np.arange(50)))
    with pytest.raises(InvalidInput, match="measured"):
        run.balance  # noqa: B018
    with pytest.raises(SceneError, match="another robot"):
        Recording.load(robot_bag, models.scene("pendulum"))


@pytest.mark.parametrize("name", KINDS)
def test_of_two_recorders_of_one_file_the_second_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if both have looked whether it exists before either has created it."""
    new_file(tmp_path / name)
    monkeypatch.setattr(Path, "exists", lambda path: False)
    with pytest.raises(InvalidInput, match=f"{name}' exists, and another recorder"):
        new_file(tmp_path / name)


def test_damage_where_channels_are_introduced_costs_that_chunk_only(tmp_path: Path) -> None:
    """The summary repeats them; files of a bag number them each by itself."""
    for k, topics in enumerate((("/a",), ("/b", "/a"))):
        writer = Writer(str(tmp_path / f"bag_{k}.mcap"))
        writer.start("ros2")
        schema = writer.register_schema("A", "ros2msg", b"")
        channels = [writer.register_channel(topic, "cdr", schema) for topic in topics]
        for row in range(2):
            writer.add_message(channels[-1], 10 * k + row, bytes(100), row)
            writer.flush()
        writer.finish()
    first = tmp_path / "bag_0.mcap"
    raw = bytearray(first.read_bytes())
    raw[raw.index(b"zstd") + 20] ^= 0xFF
    first.write_bytes(raw)
    found = read_bag(tmp_path, lambda topic, kind: True)
    kept = [(0, 1, bytes(100)), (1, 10, bytes(100)), (2, 11, bytes(100))]
    assert found.of("A")["/a"] == kept
    assert len(found.damage) == 1 and "a record (chunk) at byte" in found.damage[0]
