# SPDX-License-Identifier: Apache-2.0
"""Starts and kills of all nodes in any order: does a joint move before it is told to?

``./arm python -m benchmarks.loop.starts``. Sim, controller and dynamics node are started in an
order that is drawn, watched, and killed (SIGKILL) and started again one after the other; then all
are killed. A source of commands, the controller, is there or not. Nobody gives the controller a
goal, so no joint may move.
"""

from __future__ import annotations

import json
import os
import random
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.ros.common.transport import as_usual, clear_dead
from arm_sim.cli.demo.processes import Processes, free_domain
from arm_sim.cli.output import console, show, table

NODES = ("sim", "controller", "dynamics")
ALLOWED = 1e-6
"""How far a joint may be from where it starts in [rad] or [m]."""
WATCHED = 1.5  # [s] after each start and kill
PATIENCE = 60.0  # [s] for the first joint state


class Watch:
    """Hears the joint states and remembers the largest distance from the start."""

    def __init__(self, scene: str, domain: int) -> None:
        """Join the graph of a domain."""
        model = ArmModel(load_scene(scene))
        self._start = dict(zip(model.joint_names, model.q0.tolist(), strict=True))
        self.largest, self.heard = 0.0, 0
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = rclpy.create_node("watch", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._node.create_subscription(
            JointState, "/joint_states", self._look, qos_profile_sensor_data
        )

    def _look(self, state: JointState) -> None:
        pairs = zip(state.name, state.position, strict=True)
        away = [abs(q - self._start[name]) for name, q in pairs if name in self._start]
        self.largest, self.heard = max(self.largest, *away), self.heard + 1

    def spin(self, seconds: float) -> None:
        """Listen for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.05)

    def wait(self) -> None:
        """Listen until the sim speaks, and a while longer."""
        before, end = self.heard, time.monotonic() + PATIENCE
        while self.heard == before and time.monotonic() < end:
            self.spin(0.1)
        if self.heard == before:
            raise click.ClickException(f"no joint state in {PATIENCE:g} s")
        self.spin(WATCHED)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


def trial(scene: str, rng: random.Random, sources: bool, folder: Path) -> dict[str, Any]:
    """Start all in some order, kill and start each in another, and say how far joints moved."""
    domain, kept = free_domain(), dict(os.environ)
    os.environ.update(as_usual(), ROS_DOMAIN_ID=str(domain))
    nodes = [name for name in NODES if sources or name != "controller"]
    first, then = rng.sample(nodes, len(nodes)), rng.sample(nodes, len(nodes))
    watch = Watch(scene, domain)
    try:
        with Processes(folder) as processes:
            for name in first:
                _start(processes, name, scene)
                watch.spin(rng.uniform(0.0, 1.0))
            watch.wait()
            for name in then:
                _kill(processes, name)
                watch.spin(WATCHED)
                _start(processes, name, scene)
                watch.wait()
    finally:
        os.environ.clear()
        os.environ.update(kept)
        watch.close()
        clear_dead()
    return {"starts": first, "kills": then, "states": watch.heard, "moved": watch.largest}


def _start(processes: Processes, name: str, scene: str) -> None:
    processes.start(name, name, scene, "--with-parent")


def _kill(processes: Processes, name: str) -> None:
    os.kill(processes.ids[name], signal.SIGKILL)
    processes.stop(name)


@click.command()
@click.option("--scene", default="panda", show_default=True)
@click.option(
    "--rounds",
    default=10,
    show_default=True,
    help="Rounds, in each of which every node is killed once.",
)
@click.option("--seed", default=1, show_default=True)
@click.option("--output", type=click.Path(path_type=Path), help="File for the results.")
def main(scene: str, rounds: int, seed: int, output: Path | None) -> None:
    """Start and kill all nodes, in any order, with and without a source of commands."""
    rng, found = random.Random(seed), []
    with tempfile.TemporaryDirectory(prefix="arm_starts_") as folder:
        for k in range(rounds):
            found.append(trial(scene, rng, k % 2 == 0, Path(folder)))
            say = found[-1]
            console().print(f"round {k + 1}: {say['moved']:.1e}, {say['states']} states")
    rows = [
        (", ".join(r["starts"]), ", ".join(r["kills"]), str(r["states"]), f"{r['moved']:.1e}")
        for r in found
    ]
    columns = ("started", "killed and started again", "states heard", "moved [rad]")
    show(console(), table(columns, rows, text=(0, 1)))
    if output is not None:
        output.write_text(json.dumps(found, indent=1))
    worst = float(np.max([r["moved"] for r in found]))
    if worst > ALLOWED:
        raise click.ClickException(f"a joint moved by {worst:.2g}; allowed: {ALLOWED:g}")


if __name__ == "__main__":
    main()
