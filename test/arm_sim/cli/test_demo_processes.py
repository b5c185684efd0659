# SPDX-License-Identifier: Apache-2.0
"""Child processes of the demo: ended together, killed if they do not end, and reported."""

import signal
import stat
import subprocess
import sys
import time
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
    talker*) i=0; while [ $i -lt 20 ]; do i=$((i+1)); echo line $i; done; exit 3;;
    silent*) exit 1;;
esac
echo ready
i=0
while [ $i -lt 500 ]; do i=$((i+1)); sleep 0.02; done  # ten seconds, whatever fails
"""


@pytest.fixture
def children(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Processes:
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


def ended(children: Processes, name: str) -> None:
    children.start(name, name, "--with-parent").wait()


def test_one_that_does_not_end_is_killed_and_what_it_left_is_cleared(
    children: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The others end in an orderly way."""
    cleared = list[bool]()
    monkeypatch.setattr(processes, "clear_dead", lambda: cleared.append(True))
    with children:
        deaf, left, right = start(children, "deaf", "polite-left", "polite-right")
        children.stop("polite-left", "nobody")
        assert (left.returncode, right.poll(), cleared) == (0, None, [])
        children.stop("deaf", "polite-right")
        assert (deaf.returncode, right.returncode) == (-signal.SIGKILL, 0)
        assert cleared == [True]
    assert children.log("polite-right").read_text().split() == ["ready", "asked"]


def test_one_that_has_ended_by_itself_is_reported_until_it_is_stopped(children: Processes) -> None:
    """With what it said last."""
    with children:
        start(children, "polite")
        children.check()
        ended(children, "talker")
        with pytest.raises(DemoFailed, match="talker process .* status 3:\n    line 9\n"):
            children.check()
        children.stop("talker")
        ended(children, "silent")
        with pytest.raises(DemoFailed, match="with status 1:\nits log is empty"):
            children.check()
        children.stop("silent")
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
