# SPDX-License-Identifier: Apache-2.0
"""The system under test: four nodes in processes of their own, used as their users do."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import cycle
from pathlib import Path

import numpy as np
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics.client import ArmClient
from arm_dynamics.exceptions import Refused
from arm_sim.cli.demo.processes import DemoFailed, Processes
from benchmarks.measurement.watcher import Watcher

MOVE_EVERY = 3.0  # [s]
PARTS = 11  # of all nodes, in the diagnostics
HISTORY = 12  # requests that the transport keeps the memory of, and some
CLOCKED = "clocked/sim"
SIMS = {"sim": "sim", CLOCKED: "clocked sim"}  # nodes, and their processes
RECORDING, STATES = "topics.mcap", "clocked/joint_states"
COMMANDS = {
    "sim": ("sim", "{scene}", "--with-parent", "--ros-args", "-p", "stale_policy:=gravity", "-p",
            "time:=sim", "-p", "record:={folder}/{{time}}.mcap"),
    "controller": ("controller", "{scene}", "--with-parent"),
    "dynamics": ("dynamics", "{scene}", "--with-parent"),
    "other": ("dynamics", "--with-parent", "--ros-args", "-r", "__node:=other", "-r",
              "robot_description:=other/robot_description"),
    # A second arm, whose stamps are of the clock; they are recorded.
    "clocked sim": ("sim", "{scene}", "--with-parent", "--ros-args", "-r", "__ns:=/clocked", "-p",
                    "stale_policy:=gravity", "-p", "frame_prefix:=clocked/"),
    "clocked controller": ("controller", "{scene}", "--with-parent", "--ros-args", "-r",
                           "__ns:=/clocked"),
    "recorder": ("record", f"/{STATES}", "/joint_commands", "/clocked/joint_commands", "--out",
                 "{folder}/" + RECORDING),
    **({"view": ("view", "{scene}", "--live", "--port", "0")} if find_spec("viser") else {}),
}  # fmt: skip


class System:
    """The nodes under load.

    Attributes:
        processes: Of the nodes, by name.
        watcher: Listens to them.
        client: Asks them.
        names: Of the joints; ``n`` is their number.
        calls: Service calls that were answered.
        recordings: Folder of the recordings.
    """

    def __init__(self, scene: str, domain: int, processes: Processes, recordings: Path) -> None:
        """Start everything and wait until the loop is closed."""
        self._scene, self.processes, self.recordings = scene, processes, recordings
        for name in COMMANDS:
            self.start(name)
        self.watcher = Watcher(domain)
        self.client = ArmClient(timeout=20.0, domain=domain)
        self.names = list(self.client.model_info().joint_names)
        self.n = len(self.names)
        self._home = np.array([0.0, -0.6, 0.0, -2.0, 0.0, 1.6, 0.7])[: self.n]
        self._sign, self._moved = cycle((1.0, -1.0)), 0.0
        self.calls = 0
        self._giants()
        self.watcher.listen(2.0)
        if not self.watcher.until(lambda: len(self.watcher.latest) >= PARTS, 30.0):
            raise DemoFailed(f"diagnostics of only {sorted(self.watcher.latest)} came")

    def _giants(self) -> None:
        """Send messages beyond all limits, as many as the transport keeps the memory of.

        It keeps the buffers of the largest ones that it has seen, so that memory is looked at
        with these in it.
        """
        array = self.watcher.publisher(Float64MultiArray, "sim/commands")
        for _ in range(HISTORY):
            self.refused(np.zeros((100_001, self.n)))
            array.publish(Float64MultiArray(data=[0.0] * 100_000))

    def refused(self, q: np.ndarray) -> None:
        """Ask a question that has to be refused."""
        try:
            self.client.inverse_dynamics(q)
        except Refused:
            return
        raise DemoFailed(f"a bad request of shape {q.shape} was answered")

    def close(self) -> None:
        """Leave the graph."""
        self.client.close()
        self.watcher.close()

    def start(self, name: str) -> None:
        """Start a node's process, anew if it was there."""
        known = {"scene": self._scene, "folder": self.recordings}
        self.processes.start(name, *(word.format(**known) for word in COMMANDS[name]))

    def live(self, seconds: float) -> None:
        """Use the nodes as their users do."""
        end = time.monotonic() + seconds
        rng = np.random.default_rng(0)
        while time.monotonic() < end:
            if time.monotonic() - self._moved > MOVE_EVERY:
                self.move()
            self.client.inverse_dynamics(*rng.uniform(-1.0, 1.0, (3, 100, self.n)))
            self.calls += 1
            self.watcher.listen(0.05)

    def move(self) -> None:
        """Send the arm somewhere."""
        self._moved = time.monotonic()
        goal = self._home + 0.2 * next(self._sign)
        message = JointTrajectory(joint_names=self.names)
        message.points = [JointTrajectoryPoint(positions=goal.tolist())]
        message.points[0].time_from_start.sec = 2
        for topic in ("controller/joint_trajectory", "clocked/controller/joint_trajectory"):
            self.watcher.publisher(JointTrajectory, topic).publish(message)

    @property
    def lost(self) -> int:
        """How many ticks and messages are not in the simulation's own recording."""
        return int(self.watcher.latest["sim: recording"].values["messages lost"])


@contextmanager
def running(scene: str, domain: int, logs: Path, recordings: Path) -> Iterator[System]:
    """The system, taken down at the end whatever happens."""
    with Processes(logs) as processes:
        system = System(scene, domain, processes, recordings)
        try:
            yield system
        finally:
            system.close()
