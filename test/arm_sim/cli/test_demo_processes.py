# SPDX-License-Identifier: Apache-2.0
"""Child processes of the demo: ended together, killed if they do not end, and reported."""

import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from arm_sim.cli.demo import processes
from arm_sim.cli.demo.processes import DemoFailed, Processes

pytestmark = pytest.mark.ros

CHILD = """#!/bin/sh
# In place of Python: -P -m arm_sim.cli NAME --with-parent ...
case $4 in
    polite*) trap 'echo asked; exit 0' INT; trap 'echo forced' TERM;;
    deaf*) trap '' INT TERM;;
    gone*) echo "arguments $*"; exit 3;;
    talker*) i=0; while [ $i -lt 20 ]; do i=$((i+1)); echo line $i; done; exit 0;;
    silent*) exit 1;;
esac
echo ready
i=0
while [ $i -lt 500 ]; do i=$((i+1)); sleep 0.02; done  # ten seconds, whatever fails
"""


@pytest.fixture
def cleared(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Filled when shared memory of killed processes is cleared."""
    found = list[bool]()
    monkeypatch.setattr(processes, "clear_dead", lambda: found.append(True))
    return found


@pytest.fixture
def heard() -> Iterator[None]:
    """Child processes receive SIGINT, even if a shell started the tests with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def children(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cleared: list[bool], heard: None
) -> Processes:
    """Starts children by the name of what they do; they have little time for an orderly end."""
    script = tmp_path / "child"
    script.write_text(CHILD)
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(sys, "executable", str(script))
    monkeypatch.setattr(processes, "_PATIENCE", 0.8)
    return Processes(tmp_path)


def start(children: Processes, *names: str) -> list[subprocess.Popen[bytes]]:
    """Start children and wait until they listen to signals."""
    started = [children.start(name, name, "--with-parent") for name in names]
    for name in names:
        while "ready" not in children.log(name).read_text():
            time.sleep(1e-3)
    return started


def ended(children: Processes, name: str) -> subprocess.Popen[bytes]:
    process = children.start(name, name, "--with-parent", "--more")
    process.wait()
    return process


def test_child_processes_can_end_in_an_orderly_way(
    children: Processes, cleared: list[bool]
) -> None:
    with children:
        left, right = start(children, "polite-left", "polite-right")
        children.stop("polite-left", "nobody")
        assert left.returncode == 0
        assert right.poll() is None
    assert right.returncode == 0
    for name in ("polite-left", "polite-right"):
        assert children.log(name).read_text().split() == ["ready", "asked"]
    assert not cleared


def test_one_that_does_not_end_is_killed_and_what_it_left_is_cleared(
    children: Processes, cleared: list[bool]
) -> None:
    with children:
        deaf, polite = start(children, "deaf", "polite")
        children.stop("deaf", "polite")
        assert deaf.returncode == -signal.SIGKILL
        assert polite.returncode == 0
        assert cleared == [True]


def test_one_that_has_ended_by_itself_is_reported_until_it_is_stopped(children: Processes) -> None:
    with children:
        start(children, "polite")
        children.check()
        ended(children, "gone")
        with pytest.raises(DemoFailed) as caught:
            children.check()
        said = caught.value.message
        assert said.startswith(
            "the gone process ended unexpectedly with status 3:\n    arguments "
        )
        assert "-m arm_sim.cli gone --with-parent --more" in said
        children.stop("gone")
        children.check()


def test_what_it_said_last_is_shown(children: Processes) -> None:
    with children:
        ended(children, "talker")
        lines = children.tail("talker").splitlines()
        assert lines == [f"    line {k}" for k in range(9, 21)]
        children.stop("talker")
        ended(children, "silent")
        with pytest.raises(DemoFailed, match="with status 1:\nits log is empty"):
            children.check()


def test_nothing_that_is_pressed_keeps_children_from_being_ended(
    children: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = signal.getsignal(signal.SIGINT)
    stop = children.stop
    order = list[str]()

    def pressed(*names: str) -> None:
        order.extend(names)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.raise_signal(number)
        stop(*names)

    monkeypatch.setattr(children, "stop", pressed)
    with children:
        running = start(children, "polite-old", "polite-young")
    assert order == ["polite-young", "polite-old"]
    assert [process.returncode for process in running] == [0, 0]
    assert signal.getsignal(signal.SIGINT) is before
