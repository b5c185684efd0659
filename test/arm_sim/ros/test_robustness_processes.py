# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: killed, flooded, without disk, with another arm; the others go on."""

import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from forging import asking
from harness import Ros, segments, surroundings
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

import models
from arm_dynamics.client import ArmClient
from arm_dynamics.ros.interfaces import NEWEST

pytestmark = pytest.mark.ros

SCENE = str(models.SCENES / "two_link.yaml")
NAMES = list(models.dynamics("two_link").joint_names)
ROS_ARGS = {
    "sim": ("-p", "stale_policy:=gravity"), "controller": (), "dynamics": (),
}  # fmt: skip


class Loop:
    """A sim and a controller in separate processes, and an observer."""

    def __init__(self, ros: Ros, forge: Path, logs: Path) -> None:
        self.ros, self._forge, self._logs = ros, forge, logs
        self._environment = surroundings(ROS_DOMAIN_ID=str(ros.domain), ROS_LOG_DIR=str(logs))
        self.running: dict[str, subprocess.Popen[bytes]] = {}
        self.states: list[JointState] = []
        self.levels: dict[str, tuple[int, str]] = {}
        self.sources = "none"  # of the commands that the sim takes
        ros.peer.create_subscription(JointState, "joint_states", self._on_state, NEWEST)
        ros.peer.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def start(self, *nodes: str, sim: tuple[str, ...] = (), **streams: Any) -> None:
        """Start nodes; ``sim``: more ROS arguments of the sim."""
        streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **streams}
        for node in nodes:
            self.running[node] = subprocess.Popen(
                [*asking(self._forge), "arm", node, SCENE, "--with-parent",
                 "--ros-args", *ROS_ARGS[node], *(sim if node == "sim" else ())],
                env=self._environment | {"FORGED": str(self._logs / node)}, **streams,
            )  # fmt: skip

    def kill(self, node: str) -> None:
        self.running[node].kill()
        self.running.pop(node).wait()

    def processes(self) -> list[int]:
        """Ids of the nodes' processes."""
        return [int((self._logs / node).read_text()) for node in self.running]

    def _on_state(self, message: JointState) -> None:
        self.states.append(message)
        del self.states[:-50]

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.levels[status.name] = ord(status.level), status.message
            if status.name == "sim: commands":
                self.sources = next(x.value for x in status.values if x.key == "sources")

    def until_said(self, part: str, words: str) -> None:
        self.levels.pop(part, None)
        self.ros.spin_until(lambda: words in self.levels.get(part, (0, ""))[1], timeout=60.0)

    def until_well(self) -> None:
        """Both nodes report that all is well, and the arm is being controlled."""
        parts = ("sim: commands", "controller: controller")
        self.sources = "none"
        for part in parts:
            self.levels.pop(part, None)
        self.ros.spin_until(
            lambda: (
                self.sources != "none"
                and all(self.levels.get(part, (9, ""))[0] == 0 for part in parts)
            ),
            timeout=60.0,
        )

    def position(self) -> np.ndarray:
        self.states.clear()
        self.ros.spin_until(lambda: self.states, timeout=60.0)
        return np.array(self.states[-1].position)

    def time(self) -> float:
        self.position()
        stamp = self.states[-1].header.stamp
        return stamp.sec + 1e-9 * stamp.nanosec

    def close(self) -> None:
        for node in list(self.running):
            self.kill(node)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory, forge: Path) -> Iterator[Loop]:
    """Processes in a domain of their own; none is left behind."""
    logs = tmp_path_factory.mktemp("log")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_LOG_DIR", str(logs))
        ros = Ros()
    made = Loop(ros, forge, logs)
    yield made
    made.close()
    ros.close()


@pytest.fixture
def loop(shared: Loop) -> Loop:
    """A sim and a controller at work; tests may kill them."""
    shared.start(*({"sim", "controller"} - set(shared.running)))
    shared.until_well()
    return shared


def test_a_killed_controller_is_replaced_and_the_arm_stays(loop: Loop) -> None:
    before = loop.position()
    assert not any(map(segments, loop.processes()))  # whose locks stay
    loop.kill("controller")
    loop.until_said("sim: commands", "commands stopped")
    np.testing.assert_allclose(loop.position(), before, atol=1e-3)
    loop.start("controller")
    loop.until_well()
    np.testing.assert_allclose(loop.position(), before, atol=5e-3)


def test_a_killed_simulation_is_replaced_and_its_controller_goes_on(loop: Loop) -> None:
    loop.kill("sim")
    loop.until_said("controller: controller", "no joint state")
    loop.start("sim")
    loop.until_well()
    loop.kill("sim")
    loop.start("sim")  # at once, as by a launch file's respawn
    loop.until_well()
    assert loop.running["controller"].poll() is None
    # Before the first answer arrives the policy carries the arm.
    np.testing.assert_allclose(loop.position(), models.dynamics("two_link").model.q0, atol=5e-3)


def test_a_flood_of_commands_from_another_source_moves_nothing(loop: Loop) -> None:
    """And SIGTERM in the middle of it ends the nodes in order."""
    loop.kill("sim")  # on a busy machine the controller may be kept waiting for more than 0.1 s
    loop.start("sim", sim=("-p", "command_timeout:=2.0"))
    loop.until_well()
    before, began = loop.position(), loop.time()
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
    assert sent > 2_000
    loop.until_said("sim: commands", "two controllers")
    np.testing.assert_allclose(loop.position(), before, atol=5e-3)
    assert loop.time() > began
    for node in ("sim", "controller"):
        loop.running[node].send_signal(signal.SIGTERM)
    for _ in range(2000):
        publisher.publish(raw)
    for node in ("sim", "controller"):
        assert loop.running.pop(node).wait(timeout=60.0) == 0


@pytest.fixture
def unstarted(ros: Ros, forge: Path, tmp_path: Path) -> Iterator[Loop]:
    """No processes yet."""
    made = Loop(ros, forge, tmp_path)
    yield made
    made.close()


def test_a_full_disk_does_not_stop_the_node(unstarted: Loop) -> None:
    """What the nodes say goes to a device that has no space left."""
    loop = unstarted
    with Path("/dev/full").open("wb") as full:
        loop.start("sim", "controller", "dynamics", stdout=full, stderr=full)
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
