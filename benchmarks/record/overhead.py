# SPDX-License-Identifier: Apache-2.0
"""Two closed loops on a Panda at the same time, of which one is recorded."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from arm_dynamics import Dynamics
from arm_dynamics.ros.common.transport import as_usual
from arm_sim import Recording
from arm_sim.cli.demo.processes import Processes, free_domain
from benchmarks.measurement.watcher import processor_time

WARM, SEEN = 8.0, 3.0  # [s], and until the controller has seen the arm
SCENE = "panda"
OPENS = 30.0  # [s] that a view takes at most
SIZE = (640, 400)  # of its page
STEP, REACH = 2.0, 0.25  # [s] from waypoint to waypoint, and how far they are apart in [rad]
Record = dict[str, Any]


def measure(seconds: float, folder: Path, viewed: bool) -> Record:
    """Run both for a while; what each needed, and what is in the file.

    Args:
        seconds: How long.
        folder: For files.
        viewed: Whether a browser follows the loop that is recorded.
    """
    files = {"with": folder / "run.mcap", "without": None}
    with ExitStack() as stack:
        loops, leaders = {}, []
        for name, file in files.items():
            leaders.append(stack.enter_context(leader_node()))  # who also keeps the domain
            loops[name] = stack.enter_context(_loop(folder / name, leaders[-1], file))
            if viewed and file is not None:
                stack.enter_context(_page(loops[name]))
        for leader in leaders:
            lead(leader, seconds + WARM)
        time.sleep(WARM)
        before = {name: _used(processes) for name, processes in loops.items()}
        began = time.monotonic()
        time.sleep(seconds)
        passed = time.monotonic() - began
        after = {name: _used(processes) for name, processes in loops.items()}
    found: Record = {"seconds": passed}
    for name in files:
        cpu, memory = (b - a for a, b in zip(before[name], after[name], strict=True))
        report = json.loads((folder / name / "report.json").read_text())
        found[name] = {
            "share": cpu / passed, "memory": memory, "loop": report["loop"],
            "recording": report.get("recording"),
        }  # fmt: skip
        del found[name]["loop"]["bars"]
    return found | _file(files["with"])


@contextmanager
def leader_node() -> Iterator[Node]:
    """A node in a domain that nobody else uses."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=free_domain())
    node = Node("leader", context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        context.try_shutdown()


@contextmanager
def _loop(folder: Path, leader: Node, file: Path | None) -> Iterator[Processes]:
    """Sim and controller in the leader's domain."""
    folder.mkdir()
    os.environ |= {"ROS_DOMAIN_ID": str(leader.context.get_domain_id()), **as_usual()}
    wanted = [] if file is None else ["--ros-args", "-p", f"record:={file}"]
    with Processes(folder) as processes:
        processes.start("controller", "controller", SCENE, "--with-parent")
        report = str(folder / "report.json")
        processes.start("sim", "sim", SCENE, "--with-parent", "--report", report, *wanted)
        yield processes


@contextmanager
def _page(processes: Processes) -> Iterator[None]:
    """A view of a running loop, and a browser that draws it."""
    from arm_sim.view.pictures import page_in_browser

    processes.start("view", "view", SCENE, "--live", "--port", "0")
    end = time.monotonic() + OPENS
    while (address := re.search(r"http://\S+", processes.log("view").read_text())) is None:
        processes.check()
        if time.monotonic() > end:
            raise TimeoutError(f"the view does not open: {processes.tail('view')}")
        time.sleep(0.1)
    with page_in_browser(address[0], SIZE):
        yield


def lead(node: Node, seconds: float) -> None:
    """Send the arm around."""
    dynamics, rng = Dynamics(SCENE), np.random.default_rng(1)
    points = []
    for k in range(round(seconds / STEP)):
        place = dynamics.model.q0 + REACH * rng.uniform(-1.0, 1.0, dynamics.n)
        point = JointTrajectoryPoint(positions=place.tolist())
        point.time_from_start.sec = round(STEP * (k + 1))
        points.append(point)
    publisher = node.create_publisher(JointTrajectory, "controller/joint_trajectory", 10)
    end = time.monotonic() + 60.0
    while time.monotonic() < end and not (
        publisher.get_subscription_count() and node.count_publishers("joint_states")
    ):
        time.sleep(0.1)
    time.sleep(SEEN)
    publisher.publish(JointTrajectory(joint_names=list(dynamics.joint_names), points=points))


def _used(processes: Processes) -> tuple[float, float]:
    """Processor time in [s] and resident memory in [B] of the sim."""
    pid = processes.ids["sim"]
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return processor_time(pid), float(pages * os.sysconf("SC_PAGE_SIZE"))


def _file(path: Path | None) -> Record:
    assert path is not None
    began = time.monotonic()
    loaded = Recording.load(path)
    return {
        "ticks in the file": len(loaded) - 1,
        "gaps": len(loaded.gaps),
        "bytes a tick": path.stat().st_size / (len(loaded) - 1),
        "loaded in [s]": time.monotonic() - began,
        "moved [rad]": float(np.ptp(loaded.q, axis=0).max()),
    }
