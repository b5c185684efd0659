# SPDX-License-Identifier: Apache-2.0
"""``./arm demo``."""

import sys
from pathlib import Path
from typing import Annotated

import click

from arm_sim.cli.arguments import Scene
from arm_sim.cli.command import command

PANDA = Path(__file__).parents[2] / "scenes/panda.yaml"


@command(
    "./arm demo",
    "./arm demo --view",
    "./arm demo --robot my_arm.urdf --duration 5 --output /tmp/my_arm",
)
def demo(
    *,
    robot: Annotated[Scene | None, "--robot URDF|SCENE"] = None,
    duration: Annotated[float, click.FloatRange(1.0, 3600.0)] = 10.0,
    output: Annotated[Path, click.Path(file_okay=False, path_type=Path)] = Path("reports/demo"),
    view: bool = False,
) -> None:
    """Close the loop on an arm at 1 kHz in real time, and report the results.

    Three processes communicate over ROS 2: the simulated arm, a computed-torque controller that
    moves it along a joint trajectory, and the dynamics node, which answers torque queries during
    the motion. They use a separate ROS domain on this machine and are always terminated. The exit
    status is 1, with the reason, if the loop was not closed.

    Args:
        robot: Arm to move: a URDF or scene file; the Panda when omitted.
        duration: Duration of the motion in s.
        output: Folder for the figure, the numbers and the logs.
        view: Show the motion in the browser.
    """
    from arm_sim.cli.demo.course import run
    from arm_sim.cli.interrupts import interruptible

    with interruptible():
        try:
            run(robot or str(PANDA), duration, output, view)
        except KeyboardInterrupt:
            click.echo("interrupted; all processes of the demo have been ended", err=True)
            sys.exit(130)
