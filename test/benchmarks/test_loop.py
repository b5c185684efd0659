# SPDX-License-Identifier: Apache-2.0
"""Reports of loop and soak for given figures."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("arm_msgs")

from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.ros.common.cdr import time_bytes
from arm_sim.recording.files import McapWriter
from arm_sim.recording.files.messages import JointStateWriter
from arm_sim.ros.record.chunks import Chunk
from benchmarks.loop.baseline import lateness, spread, thread
from benchmarks.loop.hold import kept
from benchmarks.loop.page import promises, write
from benchmarks.soak.faults import FAULTS
from benchmarks.soak.page import complaints, page
from benchmarks.soak.result import Outcome, Result
from benchmarks.soak.stamps import (
    Messages,
    answers,
    had_paused,
    recorded,
    uneven,
    unexplained,
    warnings,
)

GOOD: dict[str, Any] = {
    "loop": {
        "seconds": 10.0, "priority": 0,
        "share": {"sim": 0.1, "controller": 0.12, "dynamics": 0.001},
        "thread": {"rate": 1000.0, "missed": 3, "p50": 5e-5, "p99": 1e-4, "max": 2e-3,
                   "share": 0.03, "bars": [(5e-5, 9990), (2e-3, 10)]},
        "loop": {"ticks": 10_000, "elapsed": 10.0, "missed": 6,
                 "lateness": {"p50": 5e-5, "p99": 2e-4, "max": 3e-3},
                 "bars": [(5e-5, 9990), (3e-3, 10)]},
        "round_trip": {"p50": 3e-4, "p99": 5e-4, "max": 2e-3},
    },
    "timer": {"rate": 800.0, "missed": 900, "share": 0.5},
    "ping": {"p50": 1.8e-3, "p99": 3e-3, "max": 1e-2},
    "services": {"p50": 4e-4, "p99": 1e-3, "max": 2e-3,
                 "bare": {"p50": 9e-4, "p99": 2e-3, "max": 3e-3},
                 "batches": {"inverse": {"10000": 5e5, "100000": 4e5},
                             "forward": {"10000": 5e5, "100000": 3e5}, "terms": {"10000": 1e5}}},
    "core": {name: {"compiled": 2e6, "one by one": 2e5, "difference": 1e-15}
             for name in ("inverse", "forward", "terms")},
    "lockstep": {"ticks": 10, "compiled ticks": 10,
                 "across": [{"rate": 2500.0, "digest": "a"}] * 2,
                 "alone": [{"rate": 9000.0, "digest": "a"}] * 2,
                 "compiled": [{"rate": 1e5, "digest": "b"}] * 2},
    "load": [0.5, 1.5],
}  # fmt: skip


def broken(*path: Any, value: Any) -> dict[str, Any]:
    record = copy.deepcopy(GOOD)
    place = record
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return record


def test_good_figures_keep_all_promises() -> None:
    assert all(holds for *_, holds in promises(GOOD))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("loop", "loop", "elapsed"), 10.01),
        (("loop", "loop", "missed"), 7),
        (("loop", "share", "sim"), 0.16),
        (("loop", "round_trip", "p50"), 4e-4),
        (("ping", "p50"), 7e-4),
        (("services", "p50"), 6e-4),
        (("services", "bare", "p50"), 7e-4),
        (("services", "batches", "inverse", "100000"), 1e5),
        (("services", "batches", "forward", "100000"), 1e5),
        (("core", "inverse", "compiled"), 4e5),
        (("core", "forward", "compiled"), 4e5),
        (("lockstep", "across", 0), {"rate": 1999.0, "digest": "a"}),
        (("lockstep", "compiled", 0), {"rate": 4e4, "digest": "b"}),
        (("lockstep", "across", 1), {"rate": 2500.0, "digest": "c"}),
        (("lockstep", "compiled", 1), {"rate": 1e5, "digest": "c"}),
    ],
)
def test_each_promise_can_be_broken(path: tuple[Any, ...], value: Any) -> None:
    assert [holds for *_, holds in promises(broken(*path, value=value))].count(False) == 1


def test_the_loop_s_report_is_written(tmp_path: Path) -> None:
    text = write(copy.deepcopy(GOOD), tmp_path, None).read_text()
    assert "1000.000 Hz" in text
    assert "**no**" not in text
    assert (tmp_path / "figures/loop.png").stat().st_size > 1000


def test_the_bare_thread_counts_what_began_too_late() -> None:
    found = lateness(np.array([10_000, 10_300, 1_000_001, 5_000_000]))
    assert (found["ticks"], found["missed"]) == (4, 2)
    assert found["bars"] == [
        [pytest.approx(1e-6 * n), c] for n, c in ((11, 2), (1001, 1), (5001, 1))
    ]
    assert spread(np.array([1e6, 3e6]))["p50"] == pytest.approx(2e-3)


def soaked() -> Result:
    result = Result(10.0, {fault.name: Outcome(3, 3, 3) for fault in FAULTS})
    result.memory = {"sim": [(float(t), 60.0) for t in range(100)]}
    result.rates, result.stamps = [1000.0], 10_000
    return result


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_the_bare_thread_begins_no_tick_early() -> None:
    found = thread(0.05, 500_000)
    assert found["ticks"] == 100
    assert 0.0 <= found["p50"] <= found["p99"] <= found["max"]


def test_misses_are_compared_by_tick() -> None:
    """With a bare thread that missed none, as if it had missed one."""
    new = {"missed": 6, "ticks": 20_000, "p99": 3e-4}
    bare = {"missed": 2, "ticks": 10_000, "p99": 2e-4}
    assert [got for _, _, got in kept("", new, bare, 1.3, 1.5)] == pytest.approx([1.5, 1.5])
    assert kept("", new, bare | {"missed": 0}, 1.3, 1.5)[0][2] == pytest.approx(3.0)


def test_a_good_soak_has_no_complaints() -> None:
    assert complaints(soaked()) == []
    assert "nothing was amiss" in page(soaked())


def test_memory_that_grows_is_complained_of() -> None:
    result = soaked()
    result.memory["sim"] = [(float(t), 60.0 + 0.1 * t) for t in range(100)]
    assert complaints(result) == ["sim: memory grew by 7.7 MB"]
    result.memory["sim"] = [(float(t), 60.0 + 50.0 * (t > 10)) for t in range(100)]
    assert complaints(result) == []  # what it takes while warming up


def test_an_unreported_fault_fails_the_check() -> None:
    result = soaked()
    result.outcomes[FAULTS[0].name].trouble.append("not told")
    assert complaints(result) == [f"{FAULTS[0].name}: not told"]
    assert "1 complaints" in page(result)


@pytest.mark.parametrize(
    ("flaw", "words"),
    [
        ({"unexplained": 2}, "2 of 10000 stamps are out of step"),
        ({"stamps": 0}, "0 of 0 stamps are out of step"),
        ({"false": ["flood"]}, "flood: commands were called stale, and had not paused"),
        ({"lost": 3}, "3 ticks or messages are not in the recording"),
    ],
)
def test_flaws_of_recordings_are_complained_of(flaw: dict[str, Any], words: str) -> None:
    assert complaints(replace(soaked(), **flaw)) == [words]


def test_uneven_stamps_are_found_and_lost_messages_are_none() -> None:
    stamps = 10**15 + np.array([0, 10, 20, 20, 50, 60.05, 70.2, 80, 79]) * 100_000
    assert uneven(stamps.astype(np.int64), 1_000_000).tolist() == [6, 7, 8]


def test_stamps_may_make_up_for_dropped_ticks() -> None:
    at = np.array([1.0, 10.0, 14.0, 17.0])
    assert unexplained(at, []) == 4
    assert unexplained(at, [(9.0, 10.0)]) == 2


def test_stamps_are_those_of_the_recorded_messages(tmp_path: Path) -> None:
    file, chunk = McapWriter(tmp_path / "run.mcap"), Chunk(1000)
    topics = [file.channel(name, "sensor_msgs/msg/JointState", "") for name in ("one", "two")]
    for k in range(6):
        told = JointStateWriter(["joint"])
        told.raw[told.stamp : told.stamp + 8] = time_bytes(10**10 + k)
        chunk.put(topics[k % 2], 10**9 + k, 0, bytes(told.raw))
        if k == 3:
            file.chunk(chunk.data, chunk.starts)
            chunk.clear()
    file.chunk(chunk.data, chunk.starts)
    file.close()
    found = recorded(tmp_path / "run.mcap")
    assert found["two"].stamps.tolist() == [10**10 + k for k in (1, 3, 5)]
    np.testing.assert_allclose(found["one"].at, 1.0, atol=1e-8)


@pytest.mark.parametrize(
    ("warned", "excused"),
    [
        (0.90, False),  # before the pause
        (1.11, True),
        (1.25, True),  # logged late
        (1.90, False),  # too late to be because of it
        (5.20, False),  # in a pause of the recorder
        (7.20, True),  # in one of both
        (8.00, False),
        (9.00, False),
        (10.2, True),  # they ended
    ],
)
def test_a_warning_is_excused_by_a_pause_just_before_it(warned: float, excused: bool) -> None:
    parts = (0.0, 1.001), (1.2, 7.051), (7.2, 10.001)
    sent = np.concatenate([np.arange(*part, 0.01) for part in parts])
    states = np.arange(0.0, 11.0, 0.001)
    read, heard = (
        np.where((at > 5.0) & (at < 5.3), 5.3, np.where((at > 7.0) & (at < 7.3), 7.3, at))
        for at in (sent, states)
    )
    intruder = np.arange(0.0, 10.0, 0.001)
    at = np.concatenate([read, intruder])
    order = np.argsort(at, kind="stable")
    stamps = np.concatenate([1e9 * (1.0 + sent), 0.0 * intruder])
    commands = answers(Messages(at[order], stamps[order]))
    assert had_paused(commands, np.unique(heard), warned) is excused


def test_the_times_of_warnings_are_read_from_a_log() -> None:
    log = (
        "[INFO] [1795700786.065867796] [sim]: simulates 7 joints\n"
        "[WARN] [1795700800.250000000] [clocked.sim]: no command for 0.1 s: the policy acts\n"
        "[WARN] [1795700801.000000000] [sim]: command ignored\n"
        "[INFO] [1795700801.500000000] [sim]: commands have resumed\n"
    )
    assert warnings(log) == [1795700800.25]


def test_a_soak_that_never_began_says_why() -> None:
    assert "ended early: no clock" in page(Result(1.0, ended="no clock"))
