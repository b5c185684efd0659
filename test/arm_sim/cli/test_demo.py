# SPDX-License-Identifier: Apache-2.0
"""The demo as a user starts it: it closes the loop, reports on it, and leaves nothing behind."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from harness import surroundings

pytestmark = pytest.mark.ros


class Demo:
    """A running demo and the processes that it has started."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "arm_sim.cli", "demo", "--output", str(folder), *words],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
            env=surroundings() | {"TMPDIR": str(folder.parent)},  # a killed demo removes nothing
        )  # fmt: skip
        self.said = ""

    def begins(self) -> list[int]:
        """Wait until it follows the trajectory; returns its nodes by their process ids."""
        assert self.process.stdout
        while "following the trajectory" not in self.said:
            line = self.process.stdout.readline()
            assert line, self.said
            self.said += line
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text()
        return [int(number) for number in children.split()]

    def end(self) -> int:
        """Wait for it."""
        self.said += self.process.communicate(timeout=60.0)[0]
        return self.process.returncode


Start = Callable[..., Demo]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a demo, which ends with the test."""
    started: list[Demo] = []

    def begin(*words: str) -> Demo:
        started.append(Demo(tmp_path, *words))
        return started[-1]

    yield begin
    for demo in started:
        demo.process.kill()
        demo.process.communicate()


def gone(ids: list[int], timeout: float = 0.0) -> bool:
    """Whether all processes end in time."""
    end = time.monotonic() + timeout
    while any(Path(f"/proc/{number}").exists() for number in ids):
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def test_the_loop_closes_on_a_panda(start: Start, tmp_path: Path) -> None:
    demo = start("--duration", "2")
    ids = demo.begins()
    assert len(ids) == 3  # dynamics, sim, controller
    assert demo.end() == 0, demo.said
    assert gone(ids)
    result = json.loads((tmp_path / "demo.json").read_text())
    assert result["joints"] == 7
    assert result["error_rms"] < 2e-2  # the clock of a busy machine adds to it
    assert result["energy_balance"] < 1e-6 < result["energy_dissipated"] < result["energy_moved"]
    assert result["questions"] > 10
    assert result["commands"] > 0.6 * result["ticks"]  # counted from when the nodes have met
    assert (tmp_path / "demo.png").read_bytes().startswith(b"\x89PNG")
    assert "tracking error RMS" in demo.said and "demo.png" in demo.said


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_its_processes_end_with_it(how: int, start: Start) -> None:
    """When it is interrupted before it has ended itself, even if it is killed."""
    demo = start("--duration", "30")
    ids = demo.begins()
    demo.process.send_signal(how)
    if how == signal.SIGKILL:
        demo.end()
        assert gone(ids, timeout=10.0)
        return
    assert demo.end() == 130, demo.said
    assert "interrupted; all processes of the demo have been ended" in demo.said
    assert "Traceback" not in demo.said and gone(ids)
