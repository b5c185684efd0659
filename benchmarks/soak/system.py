# SPDX-License-Identifier: Apache-2.0
"""The system under test: four nodes in processes of their own, used as their users do."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
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
HISTORY = 12  # requests that the transport keeps the memory of, and some
COMMANDS = {
    "sim": ("sim", "{scene}", "--with-parent", "--ros-args", "-p", "stale_policy:=gravity", "-p",
            "time:=sim"),
    "controller": ("controller", "{scene}", "--with-parent"),
    "dynamics": ("dynamics", "{scene}", "--with-parent"),
    "other": ("dynamics", "--with-parent", "--ros-args", "-r", "__node:=other", "-r",
              "robot_description:=other/robot_description"),
}  # fmt: skip


class System:
    """The nodes under load.

    Attributes:
        processes: Of the nodes, by name.
        watcher: Listens to them.
        client: Asks them.
        names: Of the joints; ``n`` is their number.
        calls: Service calls that were answered.
    """

    def __init__(self, scene: str, domain: int, processes: Processes) -> None:
        """Start everything and wait until the loop is closed."""
        self._scene, self.processes = scene, processes
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
        if not self.watcher.until(lambda: len(self.watcher.latest) >= 6, 30.0):
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
        self.processes.start(name, *(word.format(scene=self._scene) for word in COMMANDS[name]))

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
        topic = "controller/joint_trajectory"
        self.watcher.publisher(JointTrajectory, topic).publish(message)


@contextmanager
def running(scene: str, domain: int, folder: Path) -> Iterator[System]:
    """The system, taken down at the end whatever happens."""
    with Processes(folder) as processes:
        system = System(scene, domain, processes)
        try:
            yield system
        finally:
            system.close()
