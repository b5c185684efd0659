# SPDX-License-Identifier: Apache-2.0
"""The nodes as separate processes: they start, close the loop, and end on request."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ament_index_python.packages import get_package_prefix
from arm_msgs.srv import ModelInfo
from harness import Ros, surroundings
from samples import sampled
from sensor_msgs.msg import JointState

import models

pytestmark = pytest.mark.ros

NODES = {"dynamics": "arm_dynamics", "sim": "arm_sim", "controller": "arm_dynamics"}
SCENE = str(models.SCENES / "two_link.yaml")


class Processes:
    """Nodes started by their installed executables."""

    def __init__(self, domain: int) -> None:
        self._environment = surroundings(ROS_DOMAIN_ID=str(domain))
        self._started: list[subprocess.Popen[str]] = []

    def start(self, node: str, **parameters: Any) -> subprocess.Popen[str]:
        package = NODES[node]
        place = Path(get_package_prefix(package), "lib", package, node)
        pairs = [word for item in parameters.items() for word in ("-p", "{}:={}".format(*item))]
        return self.begin(str(place), "--ros-args", *pairs)

    def begin(self, *arguments: str, **surroundings: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            env={**self._environment, **surroundings},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._started.append(process)
        return process

    def kill(self) -> None:
        for process in self._started:
            if process.poll() is None:
                process.kill()
            process.communicate()


def stamps(messages: list[JointState]) -> set[tuple[int, int]]:
    return {(m.header.stamp.sec, m.header.stamp.nanosec) for m in messages}


@pytest.fixture
def processes(ros: Ros) -> Iterator[Processes]:
    """Starts nodes in the domain of the test, and leaves none behind."""
    started = Processes(ros.domain)
    yield started
    started.kill()


@pytest.mark.parametrize("end", sampled([signal.SIGINT, signal.SIGTERM], 1))
def test_three_processes_close_the_loop_and_end(
    ros: Ros, processes: Processes, end: signal.Signals
) -> None:
    running = {name: processes.start(name, scene=SCENE) for name in NODES}
    ros.call(ModelInfo, "/dynamics/model_info", ModelInfo.Request())
    commands = ros.listen(JointState, "/joint_commands")
    states = ros.listen(JointState, "/joint_states")
    ros.spin_until(lambda: len(commands) > 100 and len(states) > 100)
    # Whoever listens may hear the controller before the sim does.
    ros.spin_until(lambda: np.any(states[-1].effort))
    assert stamps(commands) & stamps(states)
    for process in running.values():
        process.send_signal(end)
    for name, process in running.items():
        said, _ = process.communicate(timeout=60.0)
        assert process.returncode == 0, said
        assert "Traceback" not in said, said
        assert "FATAL" not in said, said
        if name == "sim":
            assert "per second" in said


# Stands in for a compiler that takes long, and says when it is at work.
SLOW = """\
case "$*" in *--version*) echo slow 1.0; exit;; esac
echo > "$(dirname "$0")/at_work"
exec sleep 600
"""


@pytest.mark.parametrize("end", sampled([signal.SIGINT, signal.SIGTERM], 1))
def test_a_node_is_ended_at_once_while_it_is_being_built(
    processes: Processes, end: signal.Signals, tmp_path: Path
) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text(f"#!/bin/sh\n{SLOW}")
    compiler.chmod(0o700)
    entry = "from arm_sim.cli.main import main; main()"
    places = {"CC": str(compiler), "XDG_CACHE_HOME": str(tmp_path)}
    process = processes.begin("-c", entry, "sim", SCENE, **places)
    end_of_patience = time.monotonic() + 60.0
    while not (tmp_path / "at_work").exists() and process.poll() is None:
        assert time.monotonic() < end_of_patience
        time.sleep(0.05)
    process.send_signal(end)
    said, _ = process.communicate(timeout=60.0)
    assert (process.returncode, said) == (0, "starting the simulator …\n")


def test_a_command_line_that_ros_cannot_read_ends_it_with_one_error(processes: Processes) -> None:
    process = processes.start("dynamics", **{"not a name": 1})
    said, _ = process.communicate(timeout=60.0)
    assert process.returncode == 2
    assert said.count("error: ROS cannot start") == 1
    assert "Traceback" not in said
