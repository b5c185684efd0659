# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes that do not come to work: ended while they are built, and refused."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix
from harness import Ros, surroundings
from samples import sampled

import models

pytestmark = pytest.mark.ros

# Stands in for a compiler that takes long, and says when it is at work.
SLOW = """\
#!/bin/sh
case "$*" in *--version*) echo slow 1.0; exit;; esac
echo > "$(dirname "$0")/at_work"
exec sleep 600
"""
Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(ros: Ros) -> Iterator[Start]:
    """Starts Python in the domain of the test, and leaves nothing behind."""
    started = list[subprocess.Popen[str]]()

    def begin(*words: str, **more: str) -> subprocess.Popen[str]:
        environment = surroundings(ROS_DOMAIN_ID=str(ros.domain), **more)
        process = subprocess.Popen(
            [sys.executable, *words], env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        started.append(process)
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("end", sampled([signal.SIGINT, signal.SIGTERM], 1))
def test_a_node_is_ended_at_once_while_it_is_being_built(
    start: Start, end: signal.Signals, tmp_path: Path
) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text(SLOW)
    compiler.chmod(0o700)
    entry = "from arm_sim.cli.main import main; main()"
    places = {"CC": str(compiler), "XDG_CACHE_HOME": str(tmp_path)}
    process = start("-c", entry, "sim", str(models.SCENES / "two_link.yaml"), **places)
    end_of_patience = time.monotonic() + 60.0
    while not (tmp_path / "at_work").exists() and process.poll() is None:
        assert time.monotonic() < end_of_patience
        time.sleep(0.05)
    process.send_signal(end)
    said, _ = process.communicate(timeout=60.0)
    assert (process.returncode, said) == (0, "starting the simulator …\n")


def test_a_command_line_that_ros_cannot_read_ends_it_with_one_error(start: Start) -> None:
    place = Path(get_package_prefix("arm_dynamics"), "lib/arm_dynamics/dynamics")
    process = start(str(place), "--ros-args", "-p", "not a name:=1")
    said, _ = process.communicate(timeout=60.0)
    assert process.returncode == 2
    assert said.count("error: ROS cannot start") == 1
    assert "Traceback" not in said
