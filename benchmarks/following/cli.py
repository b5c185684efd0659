# SPDX-License-Identifier: Apache-2.0
"""The command line of the study: goals in simulated or real time, and a report."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from arm_dynamics import load_scene
from arm_dynamics.model import ArmModel
from arm_dynamics.ros.common.transport import as_usual
from arm_sim.cli.demo.processes import Processes, free_domain
from arm_sim.cli.interrupts import interruptible
from benchmarks.following.client import MARGIN, SCALING, START_TOLERANCE, MoveItClient
from benchmarks.following.course import Course
from benchmarks.following.rig import Rig
from benchmarks.measurement.watcher import processor_time
from benchmarks.reporting.markdown import table

ROOT = Path(__file__).parents[2]
_DESCRIPTIONS = "package://example-robot-data/robots"
ROBOTS: dict[str, dict[str, Any]] = {
    "panda": {
        "robot": {
            "urdf": f"{_DESCRIPTIONS}/panda_description/urdf/panda.urdf",
            "lock": ["panda_finger_joint1", "panda_finger_joint2"],
        },
        "initial": {"position": {
            "panda_joint2": -0.785, "panda_joint4": -2.356, "panda_joint6": 1.571,
            "panda_joint7": 0.785,
        }},
    },
    "ur5": {
        "robot": {"urdf": f"{_DESCRIPTIONS}/ur_description/urdf/ur5_robot.urdf"},
        "initial": {"position": {
            "shoulder_lift_joint": -1.2, "elbow_joint": 1.6, "wrist_1_joint": -1.9,
            "wrist_2_joint": -1.57,
        }},
    },
}  # fmt: skip
IMPERFECT: dict[str, Any] = {
    "sensors": {
        "position": {"counts": 1048576, "noise": 1e-6},
        "velocity": {"from": "position", "cutoff": 100, "order": 2},
        "effort": {"noise": 0.1},
        "delay": 0.001, "jitter": 0.001, "loss": 0.001,
    },
    "commands": {"delay": 0.001, "jitter": 0.001, "loss": 0.001},
}  # fmt: skip
EXAMPLES = """\b
Examples:
  python -m benchmarks.following                             ten minutes
  python -m benchmarks.following --realtime                  half an hour
  python -m benchmarks.following --goals 20 --cancelled 2 --replaced 2 --robot ur5
"""
_WARM = 3.0  # [s]


@click.command(epilog=EXAMPLES)
@click.option("--goals", default=200, show_default=True, type=click.IntRange(1),
              help="Goals for each robot, without and with imperfections.")  # fmt: skip
@click.option("--cancelled", default=20, show_default=True, type=click.IntRange(0),
              help="How many of them are cancelled during the motion.")  # fmt: skip
@click.option("--replaced", default=20, show_default=True, type=click.IntRange(0),
              help="How many of them are replaced during the motion.")  # fmt: skip
@click.option("--robot", "robots", multiple=True, type=click.Choice(list(ROBOTS)),
              help="Robot to test; may be repeated. [default: all]")  # fmt: skip
@click.option("--lines", multiple=True, type=click.Choice(["perfect", "imperfect"]),
              help="Quality of sensors and connections. [default: both]")  # fmt: skip
@click.option(
    "--realtime",
    is_flag=True,
    help="Run in real time; otherwise in lockstep, unaffected by the load of the machine.",
)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False),
              default=ROOT / "benchmarks/results", show_default="benchmarks/results",
              help="Folder for following.md and following.json.")  # fmt: skip
def main(
    goals: int, cancelled: int, replaced: int, robots: tuple[str, ...], lines: tuple[str, ...],
    realtime: bool, out: Path,
) -> None:  # fmt: skip
    """Send goals as MoveIt's controller manager does, and count those that end as expected.

    Goals contain only a trajectory. Each start must be within 0.01 rad of a current joint state,
    and a goal that takes longer than 1.1 times its duration plus half a second is cancelled. The
    exit status is 1 if a goal does not end as expected.
    """
    logs = out / "following_logs"
    logs.mkdir(parents=True, exist_ok=True)
    records: list[dict[str, Any]] = []
    with interruptible():
        for robot in robots or ROBOTS:
            for line in lines or ("perfect", "imperfect"):
                scene = {**ROBOTS[robot], **(IMPERFECT if line == "imperfect" else {})}
                found = _measured(scene, (goals, cancelled, replaced), logs, realtime)
                about = {"robot": robot, "lines": line, "realtime": realtime}
                records.append({**about, **found})
                _write(records, out)
    click.echo(page(records))
    if any(t["got"] < t["asked"] for record in records for t in record["tallies"].values()):
        raise SystemExit(1)


def _write(records: list[dict[str, Any]], out: Path) -> None:
    (out / "following.json").write_text(json.dumps(records, indent=1))
    (out / "following.md").write_text(page(records))


def _measured(
    scene: dict[str, Any], counts: tuple[int, int, int], logs: Path, realtime: bool
) -> dict[str, Any]:
    """Run one course."""
    os.environ |= {"ROS_DOMAIN_ID": str(free_domain()), **as_usual()}
    context = Context()
    rclpy.init(args=[], context=context, domain_id=int(os.environ["ROS_DOMAIN_ID"]),
               signal_handler_options=SignalHandlerOptions.NO)  # fmt: skip
    node = Node("moveit_simple_controller_manager", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        return (_by_the_clock if realtime else _on_a_rig)(scene, counts, logs, node, executor)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def _on_a_rig(
    scene: dict[str, Any], counts: tuple[int, int, int], _: Path, node: Node, executor: Executor
) -> dict[str, Any]:
    """The arm and its controller in this process, in simulated time."""
    rig = Rig(load_scene(scene), node.context)
    executor.add_node(rig.node)
    try:
        look = lambda: executor.spin_once(1e-3)  # noqa: E731
        client = MoveItClient(node, rig.simulator.joint_names, look, rig)
        client.connect(tries=10_000)
        return _run(client, rig.simulator.model, counts, lambda: None)
    finally:
        executor.remove_node(rig.node)
        rig.node.destroy_node()


def _by_the_clock(
    scene: dict[str, Any], counts: tuple[int, int, int], logs: Path, node: Node, executor: Executor
) -> dict[str, Any]:
    """Nodes in processes of their own, in real time."""
    file = logs / "scene.yaml"
    file.write_text(yaml.safe_dump(scene))
    model = ArmModel(load_scene(scene))
    with Processes(logs) as processes:
        processes.start("controller", "controller", str(file), "--with-parent")
        processes.start("sim", "sim", str(file), "--with-parent")
        client = MoveItClient(node, model.joint_names, lambda: executor.spin_once(1e-2))
        client.connect(tries=6000)
        client.pause(_WARM)
        began, used = time.monotonic(), processor_time(processes.ids["controller"])
        found = _run(client, model, counts, processes.check)
        used = processor_time(processes.ids["controller"]) - used
        return {**found, "share": used / (time.monotonic() - began)}


def _run(
    client: MoveItClient, model: ArmModel, counts: tuple[int, int, int], check: Callable[[], None]
) -> dict[str, Any]:
    say, course, began = Console(stderr=True), Course(client, model), time.monotonic()
    for i, _ in enumerate(course.run(*counts), 1):
        check()
        if i % 20 == 0:
            say.print(f"{i} of {counts[0]} goals")
    tallies = {kind: vars(tally) for kind, tally in course.tallies.items()}
    return {
        "seconds": time.monotonic() - began, "feedback": client.feedback, "tallies": tallies,
    }  # fmt: skip


def page(records: list[dict[str, Any]]) -> str:
    """The report in Markdown."""
    rows = [
        (
            record["robot"], record["lines"], kind, f"{t['got']} of {t['asked']}",
            f"{1e3 * t['start']:.2f}", f"{1e3 * t['goal']:.2f}", f"{1e3 * t['late']:.0f}",
            "; ".join(sorted(set(t["failures"]))),
        )
        for record in records for kind, t in record["tallies"].items() if t["asked"]
    ]  # fmt: skip
    heads = (
        "robot",
        "lines",
        "goals",
        "as expected",
        "start [mrad]",
        "end [mrad]",
        "delay [ms]",
        "failures",
    )
    runs = "; ".join(
        f"{r['robot']} {r['lines']} {r['seconds']:.0f} s"
        + (f", {100 * r['share']:.0f} % of a core for the controller" if "share" in r else "")
        for r in records
    )
    ways = "in real time" if any(r["realtime"] for r in records) else "in simulated time"
    return (
        "# Goals as MoveIt sends them\n\n"
        f"Starts within {START_TOLERANCE} rad of a current state; at most {SCALING} times the "
        f"duration plus {MARGIN} s. Largest distance from the start when a goal was sent and from "
        "the end when it succeeded, and largest time beyond its duration.\n\n"
        f"{table(heads, rows)}\n\nRun {ways}: {runs}.\n"
    )
