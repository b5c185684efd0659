# SPDX-License-Identifier: Apache-2.0
"""``./arm demo``: the control loop of an arm in three processes.

``course`` plans, starts, monitors, stops and reports; ROS and plotting are imported when it runs.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click

from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import examples

__all__ = ["demo"]

PANDA = Path(__file__).parents[2] / "scenes/panda.yaml"


@click.command(
    epilog=examples(
        "./arm demo",
        "./arm demo --view",
        "./arm demo --robot my_arm.urdf --duration 5 --output /tmp/my_arm",
    )
)
@click.option("--robot", type=SCENE, default=None, metavar="URDF|SCENE",
              help="Arm to move: a URDF or scene file; the Panda when omitted.")  # fmt: skip
@click.option("--duration", default=10.0, show_default=True, type=click.FloatRange(1.0, 3600.0),
              help="Duration of the motion in s.")  # fmt: skip
@click.option("--output", default="reports/demo", show_default=True,
              type=click.Path(file_okay=False, path_type=Path),
              help="Folder for the figure, the numbers and the logs.")  # fmt: skip
@click.option("--view", is_flag=True, help="Show the motion in the browser.")
def demo(robot: str | None, duration: float, output: Path, view: bool) -> None:
    """Close the loop on an arm at 1 kHz in real time, and report the results.

    Three processes communicate over ROS 2: the simulated arm, a computed-torque controller that
    moves it along a joint trajectory, and the dynamics node, which answers torque queries during
    the motion. They use a separate ROS domain on this machine and are always terminated. The exit
    status is 1, with the reason, if the loop was not closed.
    """
    from arm_sim.cli.demo.course import run
    from arm_sim.cli.interrupts import interruptible

    with interruptible():
        try:
            run(robot or str(PANDA), duration, output, view)
        except KeyboardInterrupt:
            click.echo("interrupted; all processes of the demo have been ended", err=True)
            sys.exit(130)
