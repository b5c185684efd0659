# SPDX-License-Identifier: Apache-2.0
"""The three paths of the README, typed as they stand, in a terminal: they arrive, and say so.

Set-up apart, which ``.ci/run`` does: ``./arm`` runs the suite as it is here, and pip installs it
without network into an environment that has its libraries.
"""

import os
import pty
import re
import select
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import page_files
import pages
import pytest
from harness import Ros, surroundings
from installed import OFFLINE, bare_environment, copied

pytestmark = pytest.mark.ros

README = (pages.ROOT / "README.md").read_text()
ROWS = re.findall(r"^\| (.+?) \| (`.+`) \|$", README.split("It does five things")[0], re.M)
PATHS = {words: re.findall(r"`([^`]+)`", typed) for words, typed in ROWS}
TORQUE, OWN_NODE, FIGURE = PATHS
SILENT = 4.0  # [s], twice what is promised: beside others, processors take up to twice as long
PATIENCE = 300.0  # [s]
NODES = r"\./arm (?:dynamics|sim)\b|\./arm python my_node"


class Typed:
    """A line that was typed into a terminal.

    Attributes:
        said: What it has printed.
        silent: The longest time without a word so far, in [s] of an idle machine.
    """

    def __init__(self, line: str, folder: Path, environment: dict[str, str]) -> None:
        self.line, self.said, self.silent = line, "", 0.0
        self._waits: dict[str, int] = {}
        self._screen, end = pty.openpty()
        self.process = subprocess.Popen(
            ["bash", "-c", line], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
            stdout=end, stderr=end, start_new_session=True,
        )  # fmt: skip
        os.close(end)

    def _kept_waiting(self) -> float:
        """Time in [s] that its processes wanted to run while others did."""
        left = [str(self.process.pid)]
        while left:
            for task in Path("/proc", left.pop(), "task").glob("*"):
                with suppress(OSError):  # it has just ended
                    self._waits[task.name] = int((task / "schedstat").read_text().split()[1])
                    left += (task / "children").read_text().split()
        return 1e-9 * sum(self._waits.values())

    def listen(self, enough: str | None = None) -> None:
        """Listen until it ends, or has said enough."""
        begin, last = time.monotonic(), time.monotonic() - self._kept_waiting()
        while time.monotonic() - begin < PATIENCE:
            now = time.monotonic() - self._kept_waiting()
            if select.select([self._screen], [], [], 0.05)[0]:
                try:
                    self.said += os.read(self._screen, 4096).decode(errors="replace")
                    ended = False
                except OSError:  # the other end is closed
                    ended = True
                    self.process.wait()
                self.silent = max(self.silent, now - last)
                last = now
                if ended or (enough and re.search(enough, self.said)):
                    return
        raise AssertionError(f"$ {self.line}\nis not done in time:\n{self.said[-2000:]}")

    def end(self) -> None:
        """Press Ctrl-C, or more."""
        for press in (signal.SIGINT, signal.SIGKILL):
            if self.process.poll() is None:
                os.killpg(self.process.pid, press)
                try:
                    self.process.wait(10.0)
                except subprocess.TimeoutExpired:
                    continue
        os.close(self._screen)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with ``./arm`` and what a reader has."""
    python, arm = sys.executable, tmp_path / "arm"
    arm.write_text(
        f'#!/bin/sh\nif [ "$1" = python ]; then shift; exec {python} "$@"; fi\n'
        f'exec {python} -P -m arm_studies.cli "$@"\n'
    )
    arm.chmod(0o755)
    page = pages.ROOT / "docs/how-to/own-node.md"
    (node,) = (step.text for step in pages.steps(page) if step.name == "my_node.py")
    (tmp_path / "my_node.py").write_text(node)
    page_files.MAKERS["my_arm.urdf"](tmp_path / "my_arm.urdf")
    return tmp_path


@pytest.fixture
def typed(folder: Path, ros: Ros) -> Iterator[dict[str, Typed]]:
    """Lines that were typed; they end with the test."""
    lines: dict[str, Typed] = {}
    yield lines
    for line in reversed(lines.values()):
        line.end()


def follow(lines: list[str], folder: Path, ros: Ros, typed: dict[str, Typed]) -> None:
    """Type the lines of a path; nodes go on."""
    environment = surroundings(ROS_DOMAIN_ID=str(ros.domain), MPLBACKEND="Agg", TERM="xterm")
    for line in lines:
        if line in typed:
            typed.pop(line).end()
        typed[line] = Typed(line, folder, environment)
        if re.match(NODES, line):
            if "my_node" not in line:  # which has nothing to say
                typed[line].listen(enough=r"\S")
            continue
        typed[line].listen()
        assert typed[line].process.returncode == 0, typed[line].said


def test_a_torque_over_ros_takes_three_commands(
    folder: Path, ros: Ros, typed: dict[str, Typed]
) -> None:
    lines = PATHS[TORQUE]
    assert 1 + len(lines) <= 3  # with git clone
    follow(lines, folder, ros, typed)
    assert re.search(r"panda_joint4\s+-2\.4\s+22\.1747", typed[lines[-1]].said)
    assert {line: t.silent for line, t in typed.items() if t.silent > SILENT} == {}


def test_an_own_node_moves_the_arm_in_five(
    folder: Path, ros: Ros, typed: dict[str, Typed]
) -> None:
    *start, look = PATHS[OWN_NODE]
    assert 1 + len(start) + 1 <= 5
    follow(start, folder, ros, typed)
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        follow([look], folder, ros, typed)
        elbow = re.search(r"elbow_joint\D+(-?[\d.]+)", typed[look].said)
        assert elbow, typed[look].said
        if abs(float(elbow[1]) - 1.2) < 0.02:  # the goal of the node
            break
    else:
        raise AssertionError(typed[look].said)
    assert {line: t.silent for line, t in typed.items() if t.silent > SILENT} == {}


def test_a_figure_of_an_own_arm_takes_three(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    lines, project = PATHS[FIGURE], copied(tmp_path_factory.mktemp("project"))
    assert 1 + len(lines) <= 3
    environment = bare_environment(tmp_path_factory.mktemp("bare"))
    (project / "my_arm.urdf").write_text((folder / "my_arm.urdf").read_text())
    (environment / "bin/pip").write_text(
        f'#!/bin/sh\nexec {shlex.quote(str(environment / "bin/python"))} -m pip "$@"\n'
    )
    (environment / "bin/pip").chmod(0o755)
    there = {
        **{name: os.environ[name] for name in ("HOME", "LANG") if name in os.environ}, **OFFLINE,
        "PATH": f"{environment / 'bin'}:/usr/bin:/bin", "MPLBACKEND": "Agg", "TERM": "xterm",
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
    }  # fmt: skip
    for line in lines:
        step = Typed(line, project, there)
        step.listen()
        step.end()
        assert step.process.returncode == 0, step.said
        assert step.silent <= SILENT, f"{line}: {step.silent:.1f} s\n{step.said[-1000:]}"
    assert (project / "falling.png").stat().st_size > 10_000
