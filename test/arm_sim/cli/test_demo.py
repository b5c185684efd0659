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

PNG = b"\x89PNG"


class Demo:
    """A running demo and the processes that it has started."""

    def __init__(self, folder: Path, *words: str) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "arm_sim.cli", "demo", "--output", str(folder), *words],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
            env=surroundings() | {"TMPDIR": str(folder.parent)},  # a killed demo removes nothing
        )  # fmt: skip
        self.said = ""

    def until(self, words: str) -> None:
        """Read what it says until it says ``words``."""
        assert self.process.stdout
        while words not in self.said:
            line = self.process.stdout.readline()
            assert line, f"it ended before it said '{words}':\n{self.said}"
            self.said += line

    def children(self) -> dict[str, int]:
        """Process ids of the nodes by name."""
        found = {}
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
                words = (folder / "cmdline").read_text().split("\0")
            except OSError:
                continue  # it has just ended
            if parent == self.process.pid:
                found[words[words.index("arm_sim.cli") + 1]] = int(folder.name)
        return found

    def end(self, timeout: float = 60.0) -> int:
        """Wait for it."""
        said, _ = self.process.communicate(timeout=timeout)
        self.said += said
        return self.process.returncode


Start = Callable[..., Demo]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts demos, and ends those that a test has left."""
    started: list[Demo] = []

    def begin(*words: str) -> Demo:
        started.append(Demo(tmp_path, *words))
        return started[-1]

    yield begin
    for demo in started:
        demo.process.kill()
        demo.process.communicate()


def gone(ids: dict[str, int], timeout: float = 10.0) -> bool:
    """Whether all processes end in time."""
    end = time.monotonic() + timeout
    while any(Path(f"/proc/{number}").exists() for number in ids.values()):
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def test_the_loop_closes_on_a_panda(start: Start, tmp_path: Path) -> None:
    demo = start("--duration", "2")
    demo.until("following the trajectory")
    ids = demo.children()
    assert sorted(ids) == ["controller", "dynamics", "sim"]
    assert demo.end() == 0, demo.said
    assert gone(ids, timeout=0.0)
    result = json.loads((tmp_path / "demo.json").read_text())
    assert result["joints"] == 7
    assert result["error_rms"] < 2e-2  # the clock of a busy machine adds to it
    assert result["energy_balance"] < 1e-6 < result["energy_dissipated"] < result["energy_moved"]
    assert result["questions"] > 10
    assert result["commands"] > 0.6 * result["ticks"]  # counted from when the nodes have met
    assert (tmp_path / "demo.png").read_bytes().startswith(PNG)
    for words in ("panda, 7 joints", "tracking error RMS", "service latency", "demo.png"):
        assert words in demo.said


def test_it_ends_its_processes_when_it_is_interrupted(start: Start) -> None:
    demo = start("--duration", "30")
    demo.until("following the trajectory")
    ids = demo.children()
    assert len(ids) == 3
    demo.process.send_signal(signal.SIGINT)
    assert demo.end() == 130, demo.said
    assert "interrupted; all processes of the demo have been ended" in demo.said
    assert "Traceback" not in demo.said
    assert gone(ids, timeout=0.0)


def test_its_processes_end_even_if_it_is_killed(start: Start) -> None:
    demo = start("--duration", "30")
    demo.until("following the trajectory")
    ids = demo.children()
    demo.process.kill()
    demo.end()
    assert gone(ids)
