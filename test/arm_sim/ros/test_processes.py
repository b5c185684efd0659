# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: killed, flooded, without disk, ended while they are built; others go on."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from forging import asking
from harness import Ros, surroundings
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import models
from arm_dynamics.client import ArmClient
from arm_dynamics.ros.interfaces import NEWEST

pytestmark = pytest.mark.ros

SCENE = str(models.SCENES / "two_link.yaml")
NAMES = list(models.dynamics("two_link").joint_names)
PARTS = "sim: commands", "controller: controller"


class Loop:
    """A sim and a controller in separate processes, and an observer."""

    def __init__(self, ros: Ros, forge: Path, logs: Path) -> None:
        self.ros, self._forge = ros, forge
        self._environment = surroundings(ROS_DOMAIN_ID=str(ros.domain), ROS_LOG_DIR=str(logs))
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        self._states: list[JointState] = []
        self._told: dict[str, Any] = {}  # the newest diagnostics, by part
        ros.peer.create_subscription(JointState, "joint_states", self._states.append, NEWEST)
        ros.peer.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def start(self, *nodes: str, output: Any = subprocess.DEVNULL, timeout: float = 0.1) -> None:
        """Start nodes; the sim takes commands for old after ``timeout`` in [s]."""
        parameters = ("-p", "stale_policy:=gravity", "-p", f"command_timeout:={timeout}")
        for node in nodes:
            self.running[node] = subprocess.Popen(
                [*asking(self._forge), "arm", node, SCENE, "--with-parent",
                 "--ros-args", *(parameters if node == "sim" else ())],
                env=self._environment, stdout=output, stderr=output,
            )  # fmt: skip

    def kill(self, node: str) -> None:
        self.running[node].kill()
        self.running.pop(node).wait()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._told.update((status.name, status) for status in message.status)

    def until_said(self, part: str, words: str) -> None:
        self._told.clear()
        self.ros.spin_until(lambda: part in self._told and words in self._told[part].message)

    def until_well(self) -> None:
        """The sim takes commands, and the controller reports that all is well."""
        self._told.clear()

        def well() -> bool:
            sim, controller = (self._told.get(part) for part in PARTS)
            values = {pair.key: pair.value for pair in sim.values} if sim else {}
            taken = values.get("sources", "none") != "none" and values["stale"] == "false"
            return taken and controller is not None and controller.level == b"\0"

        self.ros.spin_until(well)

    def state(self) -> JointState:
        """A state that is published from now on."""
        self._states.clear()
        self.ros.spin_until(lambda: self._states)
        return self._states[-1]

    def position(self) -> np.ndarray:
        return np.array(self.state().position)


@pytest.fixture
def loop(ros: Ros, forge: Path, tmp_path: Path) -> Iterator[Loop]:
    """No processes yet; none is left behind."""
    made = Loop(ros, forge, tmp_path)
    yield made
    for node in list(made.running):
        made.kill(node)


def test_killed_nodes_are_replaced_and_the_arm_stays(loop: Loop) -> None:
    loop.start("sim", "controller")
    loop.until_well()
    before = loop.position()
    loop.kill("controller")
    loop.until_said("sim: commands", "commands stopped")
    np.testing.assert_allclose(loop.position(), before, atol=1e-3)
    loop.start("controller")
    loop.until_well()
    np.testing.assert_allclose(loop.position(), before, atol=5e-3)
    loop.kill("sim")
    loop.start("sim")  # at once, as by a launch file's respawn
    loop.until_well()
    assert loop.running["controller"].poll() is None
    # Before the first answer arrives the policy carries the arm.
    np.testing.assert_allclose(loop.position(), models.dynamics("two_link").model.q0, atol=5e-3)


def test_a_flood_of_commands_from_another_source_moves_nothing(loop: Loop) -> None:
    """And SIGTERM in the middle of it ends the nodes in order."""
    # On a busy machine the controller may be kept waiting for more than 0.1 s.
    loop.start("sim", "controller", timeout=2.0)
    loop.until_well()
    before = loop.state()
    publisher = loop.ros.publisher(JointState, "joint_commands")
    message = JointState(name=NAMES, effort=[50.0, 50.0])
    message.header.frame_id = "intruder"
    raw = serialize_message(message)
    since, sent = time.monotonic(), 0
    while (passed := time.monotonic() - since) < 0.6:
        while sent < 10_000 * passed:
            publisher.publish(raw)
            sent += 1
        time.sleep(1e-3)
    loop.until_said("sim: commands", "two controllers")
    after = loop.state()
    np.testing.assert_allclose(after.position, before.position, atol=5e-3)
    assert after.header.stamp != before.header.stamp
    for node in loop.running.values():
        node.send_signal(signal.SIGTERM)
    for _ in range(2000):
        publisher.publish(raw)
    assert [node.wait(timeout=60.0) for node in loop.running.values()] == [0, 0]


def test_a_full_disk_does_not_stop_the_node(loop: Loop) -> None:
    """What the nodes say goes to a device that has no space left."""
    with Path("/dev/full").open("wb") as full:
        loop.start("sim", "controller", "dynamics", output=full)
    loop.until_well()
    publisher = loop.ros.publisher(JointState, "joint_commands")
    for _ in range(3):
        publisher.publish(JointState(name=["nobody"], effort=[1.0]))  # makes the node log
        time.sleep(0.05)
    with ArmClient(timeout=30.0, domain=loop.ros.domain) as arm:
        assert arm.inverse_dynamics(np.zeros((300, 2))).shape == (300, 2)
        arm.pause()
        assert arm.step(3) > 0.0
        arm.resume()
    assert all(process.poll() is None for process in loop.running.values())


# Stands in for a compiler that takes long, and says when it is at work.
SLOW = """\
#!/bin/sh
case "$*" in *--version*) echo slow 1.0; exit;; esac
echo > "$(dirname "$0")/at_work"
exec sleep 600
"""


def test_a_node_is_ended_at_once_while_it_is_being_built(ros: Ros, tmp_path: Path) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text(SLOW)
    compiler.chmod(0o700)
    entry = "from arm_sim.cli.main import main; main()"
    places = {"CC": str(compiler), "XDG_CACHE_HOME": str(tmp_path)}
    with subprocess.Popen(
        [sys.executable, "-c", entry, "sim", SCENE], text=True,
        env=surroundings(ROS_DOMAIN_ID=str(ros.domain), **places),
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as process:  # fmt: skip
        try:
            ros.spin_until(lambda: (tmp_path / "at_work").exists() or process.poll() is not None)
            process.send_signal(signal.SIGINT)
            said, _ = process.communicate(timeout=60.0)
        finally:
            process.kill()
    assert (process.returncode, said) == (0, "starting the simulator …\n")
