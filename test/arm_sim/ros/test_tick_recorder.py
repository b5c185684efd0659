# SPDX-License-Identifier: Apache-2.0
"""Every tick of an engine is in the file, whatever happens to the disk or the process."""

import errno
import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

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
from arm_sim.servo import JointCommand
from arm_sim.simulation.runtime_changes import payload_change


@pytest.mark.parametrize(
    ("options", "given"),
    [({}, {}), ({"tolerance": 1e-8}, {"joints": {}, "constraints": []})],
    ids=["with events", "with error control"],
)
def test_every_tick_is_in_the_file_and_comes_out_again(
    options: dict[str, Any], given: dict[str, Any], tmp_path: Path
) -> None:
    engine, path = engine_of(scene(**given), **options), tmp_path / "run.mcap"
    recorder = TickRecorder(path, engine)
    states = busy(engine)
    recorder.close()
    loaded = Recording.load(path)
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


def test_a_change_while_brakes_hold_counts_once(tmp_path: Path) -> None:
    """Set in motion, or with a heavier load: the brakes take the motion and nothing else."""
    engine, path = engine_of(scene()), tmp_path / "run.mcap"
    recorder = TickRecorder(path, engine)
    engine.configure(0.02, "brake")
    load = payload_change(engine.simulator, 0, 0.8, [0.0, 0.0, 0.1], [2e-3, 0, 0, 2e-3, 0, 2e-3])
    for action in (lambda: engine.simulator.set_state([0.4, -0.3], [1.0, 0.5]), load):
        engine.tick()
        engine.change(action)
        engine.tick()
    recorder.close()
    loaded = Recording.load(path)
    assert loaded.hold is not None and loaded.hold[:-1].all()
    np.testing.assert_allclose(np.ptp(loaded.energy - loaded.changed), 0.0, atol=1e-12)
    assert np.ptp(loaded.energy) > 1.0 and not loaded.balance.round(12).any()


def test_an_event_after_a_reset_is_at_the_time_of_the_recording(tmp_path: Path) -> None:
    engine, path = engine_of(scene()), tmp_path / "run.mcap"
    recorder = TickRecorder(path, engine)
    for ticks in 30, 20, 10:
        run(engine, ticks)
        recorder.note(f"after {ticks}")
        engine.reset()
    recorder.close()
    loaded = Recording.load(path)
    told = [(event.text, round(event.time, 9)) for event in loaded.events]
    assert told == [("after 30", 0.03), ("after 20", 0.05), ("after 10", 0.06)]
    again = Recording.load(loaded.save(tmp_path / "again.mcap"))
    assert [round(event.time, 9) for event in again.events] == [0.03, 0.05, 0.06]


def test_a_joint_state_between_ticks_is_recorded_as_it_was_published(tmp_path: Path) -> None:
    """Also if another thread writes it while the buffer already holds the next one."""
    recorder = TickRecorder(tmp_path / "run.mcap", engine_of(scene()))
    buffer = bytearray(b"first")
    recorder.published(1, buffer)
    buffer[:] = b"other"
    recorder.note("from elsewhere")
    recorder.published(2, buffer)
    recorder.close()
    assert contents(tmp_path / "run.mcap")["/joint_states"] == [b"first", b"other"]


def test_a_run_under_a_servo_is_replayed(tmp_path: Path) -> None:
    sim = Simulator(scene())
    made = sim.run(0.3, JointCommand(position=sim.state.q))
    assert made.hold is not None and made.hold.any()
    assert replay(Recording.load(made.save(tmp_path / "run.mcap"))).equal


def test_a_replay_finds_the_first_difference(tmp_path: Path) -> None:
    engine = engine_of(scene())
    recorder = TickRecorder(tmp_path / "run.mcap", engine)
    run(engine, 200)
    recorder.close()
    loaded = Recording.load(tmp_path / "run.mcap")
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


def test_another_method_is_measured_and_another_robot_refused(tmp_path: Path) -> None:
    found = replay(Simulator("two_link").run(0.05, [3.0, 1.0]), integrator="euler")
    assert found.first is not None and found.first.tick == 1
    assert found.recording.origin is not None and found.recording.origin.integrator == "euler"
    engine = engine_of(scene())
    recorder = TickRecorder(tmp_path / "run.mcap", engine)
    busy(engine)
    recorder.close()
    loaded = Recording.load(tmp_path / "run.mcap")
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


def test_a_disk_that_cannot_follow_costs_ticks_and_no_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.ros.record.chunk_thread.SIZE", 1 << 14)
    engine = engine_of(scene())
    recorder = TickRecorder(tmp_path / "run.mcap", engine)
    recorder.thread.mcap = slow = _SlowDisk(recorder.thread.mcap)
    run(engine, 1500)
    assert recorder.lost > 0, "the disk stands still, and the loop did not"
    slow.go.set()
    while recorder.thread._free.qsize() < COUNT - 2:
        time.sleep(0.001)
    run(engine, 300)
    recorder.close()
    loaded = Recording.load(tmp_path / "run.mcap")
    assert len(loaded.gaps) == 1
    assert len(loaded) == 1 + 1800 - recorder.lost + 1, "the state behind the gap is there"
    assert replay(loaded).equal
    assert loaded.energy_error < 1e-6


def test_steps_by_request_wait_for_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.ros.record.chunk_thread.SIZE", 1 << 14)
    engine = engine_of(scene())
    engine.ticks.paused = True
    recorder = TickRecorder(tmp_path / "run.mcap", engine)
    flush = recorder.thread.mcap.flush
    recorder.thread.mcap.flush = lambda: (time.sleep(0.01), flush())
    engine.step(2000)
    recorder.close()
    assert recorder.lost == 0 and len(Recording.load(tmp_path / "run.mcap")) == 2001


def test_time_goes_on_where_the_reset_itself_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The chunk with the reset is damaged; the state behind it is a tick after the one before."""
    monkeypatch.setattr("arm_sim.ros.record.chunk_thread.SIZE", 1 << 14)
    monkeypatch.setattr("arm_sim.ros.record.chunk_thread.COUNT", 100)  # on slow disks, too
    engine, path = engine_of(scene()), tmp_path / "run.mcap"
    recorder = TickRecorder(path, engine)
    run(engine, 500)
    engine.reset()
    run(engine, 500)
    recorder.close()
    raw = bytearray(path.read_bytes())
    raw[_chunk_of_last_change(path) + 100] ^= 0xFF
    path.write_bytes(raw)
    loaded = Recording.load(path)
    assert len(loaded.gaps) == 1 and len(loaded) < 1001 and not loaded.jumps
    np.testing.assert_allclose(loaded.time, 1e-3 * np.arange(len(loaded)), atol=1e-12)


def _chunk_of_last_change(path: Path) -> int:
    """Place in the file of the chunk that holds it."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary, messages = reader.get_summary(), reader.iter_messages(log_time_order=False)
        changes = [told for schema, _, told in messages if schema and "Change" in schema.name]
    assert summary is not None
    last = changes[-1].log_time
    (chunk,) = (
        chunk.chunk_start_offset
        for chunk in summary.chunk_indexes
        if chunk.message_start_time <= last <= chunk.message_end_time
    )
    return chunk


def test_an_existing_recording_stays(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(b"precious")
    with pytest.raises(InvalidInput, match="exists"):
        TickRecorder(tmp_path / "run.mcap", engine_of(scene()))
    assert (tmp_path / "run.mcap").read_bytes() == b"precious"


def test_memory_of_the_recorder_is_bounded(tmp_path: Path) -> None:
    thread = TickRecorder(tmp_path / "run.mcap", engine_of(scene())).thread
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


def test_messages_larger_than_a_chunk_are_recorded(tmp_path: Path) -> None:
    """Such as images; afterwards chunks are as small as before."""
    recorder, sizes = TickRecorder(tmp_path / "run.mcap", engine_of(scene())), (10, 10**7, 20)
    thread = recorder.thread
    for size in sizes:
        assert thread.add(recorder.file.changes, 0, 0, bytes(size))
    while thread._free.qsize() < COUNT - 2:
        time.sleep(0.01)
    assert {thread._free.get().size for _ in range(COUNT - 2)} == {SIZE}
    thread.close()
    (told,) = (raw for raw in contents(tmp_path / "run.mcap").values() if bytes(20) in raw)
    assert [len(raw) for raw in told[-3:]] == list(sizes)


@pytest.mark.parametrize(
    ("error", "trouble"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "the disk is full"),
        (OSError(errno.EDQUOT, os.strerror(errno.EDQUOT)), "the disk quota is used up"),
        (OSError(errno.EIO, os.strerror(errno.EIO)), "the recording has stopped"),
        (ZeroDivisionError("in the thread"), "the recording has stopped"),
    ],
)
def test_whatever_goes_wrong_in_the_thread_is_said(
    error: Exception, trouble: str, tmp_path: Path
) -> None:
    said: list[str] = []
    recorder = TickRecorder(tmp_path / "run.mcap", engine_of(scene()), on_failure=said.append)
    thread = recorder.thread
    assert thread.trouble == "the disk is slow"
    thread.mcap.flush = raises(error)
    thread.add(1, 0, 0, b"")
    recorder.close()
    assert thread.trouble == trouble and str(error) in thread.failure
    assert said == [thread.failure]


def test_all_that_is_not_in_the_file_after_a_failure_is_counted(tmp_path: Path) -> None:
    recorder = TickRecorder(tmp_path / "run.mcap", engine_of(scene()))
    thread = recorder.thread
    thread.mcap.flush = raises(OSError(errno.ENOSPC, "full"))
    count, big = thread.chunk.count, bytes(SIZE // 3)
    while not thread.failure or count < 20:
        thread.add(1, 0, 0, big)
        count += 1
        time.sleep(1e-3)
    recorder.close()
    assert thread.lost == count


def raises(error: Exception) -> Callable[..., None]:
    """A function that raises an exception."""

    def raising(*given: object) -> None:
        raise error

    return raising


PROGRAM = """
    import resource, sys, time
    sys.path[:0] = {paths!r}
    from pathlib import Path
    from recorded_engine import engine_of, run, scene
    from arm_sim.ros.record.ticks import TickRecorder

    engine = engine_of(scene())
    said = []
    recorder = TickRecorder(Path({path!r}), engine, on_failure=said.append)
    if {limit}:
        resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
    print("begun", flush=True)
    for _ in range({ticks}):
        run(engine, 100)
        print(engine.simulator.arm.step_count, flush=True)
        time.sleep(0.05)
    recorder.close()
    print("said", said, recorder.lost, flush=True)
"""


def program(path: Path, ticks: int, limit: int = 0) -> subprocess.Popen[str]:
    """A process that records."""
    text = textwrap.dedent(PROGRAM).format(
        paths=sys.path, path=str(path), ticks=ticks, limit=limit
    )
    return subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)


def test_a_killed_process_loses_only_what_was_not_yet_written(tmp_path: Path) -> None:
    """It writes every half second, however small a chunk is."""
    path = tmp_path / "run.mcap"
    with program(path, 100_000) as process:
        assert process.stdout is not None and process.stdout.readline() == "begun\n"
        while (made := int(process.stdout.readline())) < 1000:
            pass
        written = 0
        while written <= made:
            with suppress(InvalidInput):  # nothing is there yet
                written = len(Recording.load(path))
        process.kill()
    loaded = Recording.load(path)
    assert any("truncated" in event.text for event in loaded.events)
    assert len(loaded) >= written and not loaded.gaps
    assert replay(loaded).equal


def test_a_full_disk_is_said_and_the_simulation_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with program(path, 20, limit=60_000) as process:
        assert process.stdout is not None
        lines = process.stdout.read().splitlines()
    assert process.returncode == 0
    assert "2000" in lines, "every tick was made"
    assert "recording stopped" in lines[-1] and "too large" in lines[-1]
    assert path.stat().st_size <= 60_000
    loaded = Recording.load(path)
    assert len(loaded) > 100 and replay(loaded).equal
