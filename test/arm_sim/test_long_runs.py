# SPDX-License-Identifier: Apache-2.0
"""Long runs: Ctrl-C ends them soon, they say how far they are, and need no more than there is."""

import io
import itertools
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_controllers import Springs

import models
from arm_dynamics import InvalidInput
from arm_dynamics.trajectory import Waypoint
from arm_sim import ClosedLoop, Recording, Simulator, memory, progress
from arm_sim.stepping import slices

SOON = 15.0  # [s] of a busy machine; each of these would take minutes
WORKS = """
import sys
import numpy as np
from arm_sim import ClosedLoop, Simulator, memory

memory.LARGEST_SHARE = 1e9
sim = Simulator("two_link", tolerance=1e-10)
smooth = Simulator("two_link", integrator="rk4", dt=1e-3)
pair, folder = ClosedLoop("two_link"), sys.argv[1]
rest, still, many = np.tile(smooth.state.q, (8, 1)), np.zeros((8, 2)), np.zeros((30_000_000, 2))
works = {
    "run": lambda: sim.run(20_000.0),
    "record": lambda: sim.record(folder + "/run.mcap", 200_000.0),
    "closed loop": lambda: pair.record(folder + "/loop.mcap", 20_000.0),
    "rollout": lambda: smooth.rollout(rest, still, still[0], 200_000_000, last_only=True),
    "gradient": lambda: smooth.rollout_gradient(rest, still, still[0], 10**6, cost),
    "batch": lambda: [smooth.dynamics.inverse(many, many, many) for _ in range(100)],
}
cost = np.broadcast_to(1.0, (8, 10**6 + 1, 4))
smooth.rollout(rest, still, still[0], 3000), smooth.dynamics.inverse(*3 * [many[:9000]])
smooth.rollout_gradient(rest, still, still[0], 3, cost[:, :4])
for name, work in works.items():
    try:
        print(name, flush=True)
        work()
    except KeyboardInterrupt:
        print("ended", flush=True)
"""


def test_ctrl_c_ends_what_takes_long(tmp_path: Path) -> None:
    command, recorded = [sys.executable, "-c", WORKS, str(tmp_path)], tmp_path / "run.mcap"
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            for name in process.stdout:
                time.sleep(0.2)
                while name == "record\n" and not (recorded.exists() and recorded.stat().st_size):
                    time.sleep(0.1)
                begin = time.monotonic()
                process.send_signal(signal.SIGINT)
                assert process.stdout.readline() == "ended\n", name
                assert time.monotonic() - begin < SOON, name
        finally:
            process.kill()
    broken_off = Recording.load(recorded)
    assert 0 < len(broken_off) < 1e7 and np.isfinite(broken_off.q).all()


def test_a_run_that_is_broken_off_is_where_its_count_says() -> None:
    sim, other = (Simulator("two_link", integrator="rk4", dt=1e-3) for _ in range(2))
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    sim.run(0.1, [1.0, 0.0])  # so that all is compiled
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    with pytest.raises(KeyboardInterrupt):
        sim.run(3e3, [1.0, 0.0])
    signal.signal(signal.SIGALRM, before)
    assert 100 < sim.arm.step_count < 3_000_000
    unbroken = other.run(sim.state.time, [1.0, 0.0])
    np.testing.assert_array_equal(unbroken.q[-1], sim.state.q)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown(monkeypatch: pytest.MonkeyPatch, step: float, ticks: int = 20) -> list[str]:
    """What a terminal shows of a run in which each look at the clock takes a time."""
    times = itertools.count(100.0, step)
    for module in (progress, slices):
        monkeypatch.setattr(module, "perf_counter", lambda: next(times))
    screen, sim = Terminal(), models.simulator("two_link", integrator="rk4", dt=0.1)
    with redirect_stderr(screen):
        sim.run(0.1 * ticks, lambda state: [0.0, 0.0])
    return screen.getvalue().split("\r")


def test_progress_is_reported_after_two_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(monkeypatch, 0.02) == [""], "quick"
    before, *lines, erased, rest = shown(monkeypatch, 0.15)
    assert before == erased.strip() == rest == ""
    assert all(line.split(" of 2 s simulated")[0] >= "0.6" for line in lines), lines
    assert 2 < len(lines) < 15, "not from the start, and not each tick"


def test_what_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = models.simulator("two_link", integrator="rk4", dt=1e-3)
    monkeypatch.setattr(memory, "_available", lambda: 5e8)
    with pytest.raises(InvalidInput, match=r"10000000 time steps takes \d\.\d+ GB .* the 0.5 GB"):
        sim.run(1e4)
    assert sim.state.time == 0.0
    monkeypatch.setattr(memory, "_UNCHECKED", 0)
    monkeypatch.setattr(memory, "_available", lambda: 5e5)
    with pytest.raises(InvalidInput, match=r"record\(path, duration"):
        sim.run(5.0)
    assert len(sim.run(1.0)) == 1001
    still = np.zeros((50, 2))
    with pytest.raises(InvalidInput, match="50 arms over 999 time steps.*last_only=True"):
        sim.rollout(still, still, [0.0, 0.0], 999)
    assert sim.rollout(still, still, [0.0, 0.0], 999, last_only=True).shape == (50, 4)


def test_the_memory_of_a_container_counts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(memory, "_GROUPS", tmp_path)
    for name, text in {"current": "7e5", "stat": "a 1\ninactive_file 2e5", "max": "max"}.items():
        (tmp_path / f"memory.{name}").write_text(text)
    assert 1e6 < memory._available() < float("inf")
    (tmp_path / "memory.max").write_text("1000000\n")
    assert memory._available() == 5e5


def in_a_loop(folder: Path) -> tuple[Any, Any]:
    pairs = ClosedLoop("two_link", dt=1e-3), ClosedLoop("two_link", dt=1e-3)
    for pair in pairs:
        pair.follow([Waypoint(0.1, [0.3, -0.2])])
    return pairs[0].run(0.25), pairs[1].record(folder / "streamed.mcap", 0.25)


def alone(control: Any) -> Any:
    def made(folder: Path) -> tuple[Any, Any]:
        one, two = (Simulator("two_link", integrator="rk4", dt=1e-3) for _ in range(2))
        act = (control(sim.dynamics) if control is Springs else control for sim in (one, two))
        return one.run(0.25, next(act)), two.record(folder / "streamed.mcap", 0.25, next(act))

    return made


@pytest.mark.parametrize(
    "make", [in_a_loop, alone(Springs), alone([0.1, -0.2])],
    ids=["closed loop", "controller", "torques"],
)  # fmt: skip
def test_a_streamed_file_is_a_saved_one(
    make: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.simulation.simulator.TICKS_PER_PART", 60)
    motion, path = make(tmp_path)
    motion.save(tmp_path / "saved.mcap")
    streamed, saved = Recording.load(path), Recording.load(tmp_path / "saved.mcap")
    for name in ("time", "q", "v", "z", "tau", "command", "local_error", "time_stepped"):
        np.testing.assert_array_equal(getattr(streamed, name), getattr(saved, name), name)
    assert streamed.origin == saved.origin and streamed.events == saved.events
