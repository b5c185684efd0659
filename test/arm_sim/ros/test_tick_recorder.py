# SPDX-License-Identifier: Apache-2.0
"""Every tick of an engine is in the file, whatever happens to the disk or the process."""

import errno
import os
import shutil
import time
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from mcap.reader import make_reader
from recorded_engine import busy, contents, engine_of, run, scene

from arm_dynamics import InvalidInput, load_scene
from arm_sim import Recording, Simulator
from arm_sim.replay import replay
from arm_sim.ros.record.chunk import PERIOD_NS, Chunk
from arm_sim.ros.record.chunk_thread import COUNT, SIZE
from arm_sim.ros.record.ticks import TickRecorder
from arm_sim.ros.tick_engine import TickEngine

SMALL = 1 << 14  # bytes of a chunk where more than one is to be filled


@pytest.fixture
def engine() -> TickEngine:
    return engine_of(scene())


@pytest.fixture
def recorder(engine: TickEngine, tmp_path: Path) -> TickRecorder:
    """Records ``engine``."""
    return TickRecorder(tmp_path / "run.mcap", engine)


def recorded(recorder: TickRecorder) -> Recording:
    """What is in the file after it was closed."""
    recorder.close()
    return Recording.load(recorder.path)


@pytest.mark.parametrize(
    ("options", "given"),
    [({}, {}), ({"tolerance": 1e-8}, {"joints": {}, "constraints": []})],
    ids=["with events", "with error control"],
)
def test_every_tick_is_in_the_file_and_comes_out_again(
    options: dict[str, Any], given: dict[str, Any], tmp_path: Path
) -> None:
    engine = engine_of(scene(**given), **options)
    recorder = TickRecorder(tmp_path / "run.mcap", engine)
    states = busy(engine)
    loaded = recorded(recorder)
    assert recorder.ticks == len(states) == 850 and recorder.lost == 0
    ended = np.hstack([loaded.q, loaded.v, loaded.z])
    for jump in loaded.jumps:
        ended[jump.row] = jump.x
    assert ended[1:].tobytes() == np.array(states).tobytes()
    assert not loaded.gaps and len(loaded.jumps) == 4  # load, pushable, state, reset
    np.testing.assert_allclose(loaded.time, 1e-3 * np.arange(851), atol=1e-12)
    found = replay(loaded)
    assert found.equal, found.first
    assert not found.apart.any()


def test_what_holds_the_arm_and_what_changes_it_is_recorded(
    engine: TickEngine, recorder: TickRecorder
) -> None:
    """Set in motion while brakes hold it: they take that motion and nothing else, and once."""
    engine.configure(0.02, "brake")
    for state in ([0.1, 0.2], [0.0, 0.0]), ([0.4, -0.3], [1.0, 0.5]):
        engine.change(lambda state=state: engine.simulator.set_state(*state))
        engine.tick()
        engine.tick()
    loaded = recorded(recorder)
    assert loaded.hold is not None and loaded.hold[:-1].all()
    assert np.ptp(loaded.energy) > 1.0
    np.testing.assert_allclose(np.ptp(loaded.energy - loaded.changed), 0.0, atol=1e-12)


def test_an_event_after_a_reset_is_at_the_time_of_the_recording(
    engine: TickEngine, recorder: TickRecorder, tmp_path: Path
) -> None:
    for ticks in 30, 20, 10:
        run(engine, ticks)
        recorder.note(f"after {ticks}")
        engine.reset()
    loaded = recorded(recorder)
    told = [(event.text, round(event.time, 9)) for event in loaded.events]
    assert told == [("after 30", 0.03), ("after 20", 0.05), ("after 10", 0.06)]
    again = Recording.load(loaded.save(tmp_path / "again.mcap"))
    assert [round(event.time, 9) for event in again.events] == [0.03, 0.05, 0.06]


def test_a_joint_state_between_ticks_is_recorded_as_it_was_published(
    recorder: TickRecorder,
) -> None:
    """Also if another thread writes it while the buffer already holds the next one."""
    buffer = bytearray(b"first")
    recorder.add_state(1, buffer)
    buffer[:] = b"other"
    recorder.note("from elsewhere")
    recorder.add_state(2, buffer)
    recorder.close()
    assert contents(recorder.path)["/joint_states"] == [b"first", b"other"]


def test_a_replay_finds_the_first_difference(engine: TickEngine, recorder: TickRecorder) -> None:
    run(engine, 200)
    loaded = recorded(recorder)
    v = loaded.v.copy()
    v[120, 1] = np.nextafter(v[120, 1], 9.0)
    found = replay(replace(loaded, v=v))
    assert found.first is not None and not found.equal
    assert (found.first.tick, found.first.what) == (120, "velocity of elbow")
    assert 0.0 < found.first.size < 1e-15


def test_a_gap_before_the_last_state_comes_out_again() -> None:
    made = Simulator(scene()).run(0.01)
    cut = replace(made, gaps=(4, len(made) - 1))
    assert replay(cut).recording.gaps == (4, 10)


def test_another_method_is_measured_and_another_robot_refused(
    engine: TickEngine, recorder: TickRecorder
) -> None:
    busy(engine)
    loaded = recorded(recorder)
    found = replay(loaded, integrator="euler")
    assert found.first is not None and found.first.tick == 1
    assert found.recording.origin is not None and found.recording.origin.integrator == "euler"
    assert replay(loaded, scene=scene()).equal
    with pytest.raises(InvalidInput, match="payload"):
        replay(loaded, scene=scene(tunable=[]))
    with pytest.raises(InvalidInput, match="joints"):
        replay(loaded, scene="panda")


def test_a_scene_with_other_internal_states_is_compared_by_the_motion_of_its_joints() -> None:
    """From rest without load bristles hold where nothing else does, and then they do not."""
    plain, bristles = Simulator("two_link"), load_scene("two_link").model_dump(exclude_unset=True)
    lugre = {"coulomb": 1.0, "lugre": {"sigma0": 1e4}}
    bristles["joints"] = {"elbow": {"friction": lugre}}
    made = plain.run(0.05, [3.0, 1.0])
    found = replay(made, scene=bristles)
    assert found.first is not None and found.first.tick == 1 and not found.equal
    assert found.first.what.startswith(("position of", "velocity of"))
    apart = abs(found.recording.q - made.q).max(axis=1)
    np.testing.assert_allclose(found.apart, apart, atol=1e-12)
    back = replay(found.recording, scene="two_link")
    np.testing.assert_allclose(back.recording.q, made.q, atol=1e-9)
    np.testing.assert_allclose(back.apart, apart, atol=1e-9)


class _SlowDisk:
    """A file that does not take anything until it is let go."""

    def __init__(self, file: Any) -> None:
        self._file, self.go = file, Event()

    def flush(self) -> None:
        self.go.wait()
        self._file.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def until_written(recorder: TickRecorder) -> None:
    """Wait until the thread holds no chunk."""
    while recorder.thread._free_chunks.qsize() < COUNT - 1:
        time.sleep(0.001)


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("arm_sim.ros.record.chunk_thread.SIZE", SMALL)


def test_a_disk_that_cannot_follow_costs_ticks_and_no_time(
    small_chunks: None, engine: TickEngine, recorder: TickRecorder
) -> None:
    recorder.thread.mcap = slow = _SlowDisk(recorder.thread.mcap)
    run(engine, 1500)
    assert recorder.lost > 0, "the disk stands still, and the loop did not"
    slow.go.set()
    until_written(recorder)
    run(engine, 300)
    loaded = recorded(recorder)
    assert len(loaded.gaps) == 1
    assert len(loaded) == 1 + 1800 - recorder.lost + 1, "the state behind the gap is there"
    assert replay(loaded).equal
    assert loaded.energy_error < 1e-6


def test_steps_by_request_wait_for_the_disk(
    small_chunks: None, engine: TickEngine, recorder: TickRecorder
) -> None:
    engine.ticks.paused = True
    flush = recorder.thread.mcap.flush
    recorder.thread.mcap.flush = lambda: (time.sleep(0.01), flush())
    engine.step(2000)
    assert len(recorded(recorder)) == 2001 and recorder.lost == 0


def test_time_goes_on_where_the_reset_itself_is_lost(
    small_chunks: None, engine: TickEngine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The chunk with the reset is damaged; the state behind it is a tick after the one before."""
    monkeypatch.setattr("arm_sim.ros.record.chunk_thread.COUNT", 100)  # on slow disks, too
    recorder = TickRecorder(tmp_path / "run.mcap", engine)
    run(engine, 500)
    engine.reset()
    run(engine, 500)
    recorder.close()
    with recorder.path.open("rb") as file:
        summary = make_reader(file).get_summary()
        *_, (_, _, reset) = make_reader(file).iter_messages("/sim/changes")
    assert summary is not None
    (chunk,) = (
        chunk.chunk_start_offset
        for chunk in summary.chunk_indexes
        if chunk.message_start_time <= reset.log_time <= chunk.message_end_time
    )
    raw = bytearray(recorder.path.read_bytes())
    raw[chunk + 100] ^= 0xFF
    recorder.path.write_bytes(raw)
    loaded = Recording.load(recorder.path)
    assert len(loaded.gaps) == 1 and len(loaded) < 1001 and not loaded.jumps
    np.testing.assert_allclose(loaded.time, 1e-3 * np.arange(len(loaded)), atol=1e-12)


def test_memory_of_the_recorder_is_bounded(recorder: TickRecorder) -> None:
    thread = recorder.thread
    thread.mcap = slow = _SlowDisk(thread.mcap)
    taken = sum(thread.add(1, 0, 0, bytes(100_000)) for _ in range(1000))
    assert taken <= 10 * COUNT and thread.lost == 1000 - taken
    assert not thread.add_all(0, [(1, 0, bytes(50_000))] * 3)
    assert thread.lost == 1000 - taken + 3, "each of those that belong together"
    slow.go.set()
    thread.close()


def test_a_chunk_takes_what_just_fits_until_it_is_too_old() -> None:
    chunk, now = Chunk(SIZE), 1_700_000_000_000_000_001
    assert chunk.fits(now, SIZE) and not chunk.fits(now, SIZE + 1)
    chunk.put(7, now, 0, b"message")
    assert chunk.fits(now, SIZE - chunk.at) and not chunk.fits(now, SIZE - chunk.at + 1)
    assert chunk.fits(now + PERIOD_NS, 0) and not chunk.fits(now + PERIOD_NS + 1, 0)
    chunk.clear()
    assert chunk.fits(now + PERIOD_NS + 1, 0), "an empty one has no age"


def test_messages_larger_than_a_chunk_are_recorded(recorder: TickRecorder) -> None:
    """Such as images; afterwards chunks are as small as before."""
    thread, sizes = recorder.thread, (10, 10**7, 20)
    for size in sizes:
        assert thread.add(recorder.file.change_channel, 0, 0, bytes(size))
    until_written(recorder)
    assert {thread._free_chunks.get().size for _ in range(COUNT - 1)} == {SIZE}
    thread.close()
    told = contents(recorder.path)["/sim/changes"]
    assert [len(raw) for raw in told[-3:]] == list(sizes)


@pytest.mark.parametrize(
    ("error", "trouble"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "the disk is full"),
        (ZeroDivisionError("in the thread"), "the recording has stopped"),
    ],
)
def test_whatever_goes_wrong_in_the_thread_is_said_and_what_is_lost_counted(
    error: Exception, trouble: str, engine: TickEngine, tmp_path: Path
) -> None:
    said: list[str] = []
    recorder = TickRecorder(tmp_path / "run.mcap", engine, on_failure=said.append)
    thread = recorder.thread
    assert thread.trouble == "the disk is slow"
    thread.mcap.flush = Mock(side_effect=error)
    count = thread.chunk.count
    while not thread.failure or count < 20:
        thread.add(1, 0, 0, bytes(SIZE // 3))
        count += 1
        time.sleep(1e-3)
    recorder.close()
    assert thread.trouble == trouble and str(error) in thread.failure
    assert said == [thread.failure]
    assert thread.lost == count


def test_a_full_disk_is_said_and_the_simulation_goes_on(
    small_chunks: None, engine: TickEngine, tmp_path: Path
) -> None:
    said: list[str] = []
    recorder = TickRecorder(tmp_path / "run.mcap", engine, on_failure=said.append)
    run(engine, 500)
    until_written(recorder)
    with Path("/dev/full").open("wb") as full:  # a device that has no space left
        os.dup2(full.fileno(), recorder.thread.mcap.file.fileno())
    run(engine, 1500)
    loaded = recorded(recorder)
    assert engine.simulator.arm.step_count == 2000, "every tick was made"
    assert len(said) == 1 and "the disk is full" in said[0]
    assert 100 < len(loaded) < 600 and replay(loaded).equal


def test_a_killed_process_loses_only_what_was_not_yet_written(
    engine: TickEngine, recorder: TickRecorder, tmp_path: Path
) -> None:
    """It writes every half second, however small a chunk is."""
    run(engine, 300)
    written, end = recorder.thread.written, time.monotonic() + 60.0
    while recorder.thread.written == written:
        assert time.monotonic() < end
        time.sleep(0.01)
    run(engine, 100)
    left = Path(shutil.copy(recorder.path, tmp_path / "left.mcap"))
    recorder.close()
    loaded = Recording.load(left)
    assert any("truncated" in event.text for event in loaded.events)
    assert len(loaded) >= 301 and not loaded.gaps
    assert replay(loaded).equal
