# SPDX-License-Identifier: Apache-2.0
"""How long a controller node keeps a joint state waiting while long goals come in.

./arm python -m benchmarks.latency.long_goals

A Panda's controller runs in a process of its own and is sent a joint state every millisecond;
into that come goals of many points. A state counts as answered when a command comes that answers
it or a later one. Real-time priority is taken where it is permitted, so that other work on the
machine does not count; windows in which no goal comes show what is left of it.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PosePath
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rich.console import Console
from rich.table import Table
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.ros.common.direct import Newest
from arm_dynamics.ros.common.privileges import ThreadParams
from arm_dynamics.ros.common.transport import as_usual
from arm_dynamics.ros.interfaces import (
    CARTESIAN_PATH,
    JOINT_COMMANDS,
    JOINT_STATES,
    JOINT_TRAJECTORY,
)
from arm_dynamics.ros.joint_state import JointStateReader, JointStateWriter
from arm_dynamics.task_space import TaskSpace, quaternions
from arm_sim.cli.demo.processes import Processes, free_domain

FRAME = "panda_hand_tcp"
TICK = 1_000_000  # [ns]
TRIALS = 8
WARM = 2000  # ticks
PRIORITY = 40
WINDOW, PAUSE = 1000, 1000  # ticks


class Partner:
    """Sends states and goals, and notes when states are answered."""

    def __init__(self, scene: str) -> None:
        """Join the domain of the environment."""
        self.dynamics = Dynamics(load_scene(scene))
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self._node = node = Node("partner", namespace="controller", context=self._context)
        names = self.dynamics.joint_names
        self._states = node.create_publisher(
            JOINT_STATES.type, f"/{JOINT_STATES.name}", JOINT_STATES.publish
        )
        commands = JOINT_COMMANDS._replace(name=f"/{JOINT_COMMANDS.name}")
        self._answers = Newest(node, commands)
        self._writer = JointStateWriter(names, ("position", "velocity"))
        self._reader = JointStateReader(names, ("effort",), partial=False, extra=False)
        self._goals = {
            topic.type: node.create_publisher(
                topic.type, topic.name.replace("~", "/controller"), topic.publish
            )
            for topic in (JOINT_TRAJECTORY, CARTESIAN_PATH)
        }
        self._tick = 0

    def found(self) -> bool:
        """Whether the controller listens to everything."""
        publishers = (self._states, *self._goals.values())
        return all(publisher.get_subscription_count() for publisher in publishers)

    def send(self, kind: type, goal: bytes) -> None:
        """Publish a serialized goal."""
        self._goals[kind].publish(goal)

    def waits(self, ticks: int, begin: Callable[[], None]) -> np.ndarray:
        """Time in [ms] until each of some states was answered; ``begin`` is called after one."""
        rest = np.zeros(self.dynamics.n)
        sent, came, first = [], np.full(ticks, np.inf), self._tick
        deadline = time.monotonic_ns()
        for k in range(ticks):
            deadline += TICK
            time.sleep(max(0.0, 1e-9 * (deadline - time.monotonic_ns())))
            sent.append(time.time_ns())
            state = self._writer.write((first + k) * TICK, self.dynamics.model.q0, rest)
            self._states.publish(state)
            if k == 10:
                begin()
            self._collect(first, came)
        time.sleep(0.2)
        self._collect(first, came)
        self._tick += ticks
        answered = np.minimum.accumulate(came[::-1])[::-1]
        return 1e-6 * (answered - np.array(sent))[: ticks - 100]

    def _collect(self, first: int, came: np.ndarray) -> None:
        while (taken := self._answers.take()) is not None:
            raw, at = taken
            k = self._reader.read(raw)[0] // TICK - first
            if 0 <= k < len(came):
                came[k] = at

    def close(self) -> None:
        """Leave the domain."""
        self._answers.close()
        self._node.destroy_node()
        self._context.try_shutdown()


def trajectory(dynamics: Dynamics, points: int, seconds: float) -> bytes:
    """There and back again, with velocities and accelerations."""
    message = JointTrajectory(joint_names=list(dynamics.joint_names))
    w = 2 * np.pi / seconds
    for s in np.linspace(0.0, seconds, points + 1)[1:]:
        swing = 0.05 * np.array([(1 - np.cos(w * s)) ** 2,
                                 2 * w * np.sin(w * s) * (1 - np.cos(w * s)),
                                 2 * w * w * (np.cos(w * s) - np.cos(2 * w * s))])  # fmt: skip
        swing[1:] *= s < seconds
        q, v, a = swing[:, None] + np.zeros(dynamics.n)
        point = JointTrajectoryPoint(
            positions=(dynamics.model.q0 + q).tolist(), velocities=v.tolist(),
            accelerations=a.tolist(),
        )  # fmt: skip
        at = round(1e9 * s)
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(at, 10**9)
        message.points.append(point)
    return bytes(serialize_message(message))


def path(dynamics: Dynamics, poses: int, length: float) -> bytes:
    """Along a straight line and back, in equal steps."""
    home = TaskSpace(dynamics, FRAME).pose(dynamics.model.q0)
    message = PosePath()
    for k in range(1, poses + 1):
        stamped = PoseStamped()
        at, turn = stamped.pose.position, stamped.pose.orientation
        away = length * min(k, poses - k) / poses
        at.x, at.y, at.z = (home.position + [0.0, away, 0.0]).tolist()
        turn.x, turn.y, turn.z, turn.w = quaternions(home.rotation).tolist()
        message.poses.append(stamped)
    return bytes(serialize_message(message))


def main() -> None:
    """Print how long states waited, for every kind of goal."""
    os.environ |= as_usual()
    os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    scene = str(files("arm_sim") / "scenes/panda.yaml")
    wanted = [f"priority:={PRIORITY}", f"task_frame:={FRAME}", "cartesian_speed:=1.0"]
    with tempfile.TemporaryDirectory() as folder, Processes(Path(folder)) as processes:
        given = [word for setting in wanted for word in ("-p", setting)]
        processes.start("controller", "controller", scene, "--ros-args", *given)
        partner = Partner(scene)
        try:
            table = _table(_measured(partner))
        finally:
            partner.close()
        said = processes.log("controller").read_text()
    Console(width=110).print(table)
    print(f"{said.count('following')} goals followed, {said.count('refused')} refused")


def _measured(partner: Partner) -> dict[str, list[np.ndarray]]:
    dynamics = partner.dynamics
    goals = {
        "10 points": (JointTrajectory, trajectory(dynamics, 10, 0.7)),
        "1000 points": (JointTrajectory, trajectory(dynamics, 1000, 0.7)),
        "10 000 points": (JointTrajectory, trajectory(dynamics, 10_000, 0.7)),
        "1000 poses": (PosePath, path(dynamics, 1000, 0.1)),
    }
    while not partner.found():
        time.sleep(0.05)
    ThreadParams(priority=PRIORITY).claim()
    partner.waits(WARM, lambda: None)
    found: dict[str, list[np.ndarray]] = {what: [] for what in ("none", *goals)}
    for _ in range(TRIALS):
        for what, windows in found.items():
            goal = goals.get(what)
            begin = (lambda: None) if goal is None else lambda g=goal: partner.send(*g)
            windows.append(partner.waits(WINDOW, begin))
            partner.waits(PAUSE, lambda: None)
    return found


def _table(found: dict[str, list[np.ndarray]]) -> Table:
    """Median wait, and the longest of every window: its median and its worst."""
    title = "time in ms from a joint state to its answer"
    heads = "goal", "median", "longest of a window: median", "worst"
    table = Table(*heads, title=title)
    for what, windows in found.items():
        longest = [window.max() for window in windows]
        numbers = np.median(np.concatenate(windows)), np.median(longest), max(longest)
        table.add_row(what, *(f"{number:.2f}" for number in numbers))
    return table


if __name__ == "__main__":
    main()
