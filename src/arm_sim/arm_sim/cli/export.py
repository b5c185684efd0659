# SPDX-License-Identifier: Apache-2.0
"""``./arm export``: a scene as a C library that needs nothing of the suite."""

from __future__ import annotations

from pathlib import Path

import click

from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import examples


def _no_float(context: click.Context, option: click.Parameter, given: bool) -> None:
    if given:
        raise click.UsageError("--float is gone, all code is in double precision: leave it out")


@click.command(
    epilog=examples(
        "./arm export panda --out panda_c",
        "./arm export panda --out panda_fmu --fmu",
        "./arm export my_arm.urdf --out my_arm_c --name my_arm --frame tool",
        "./arm export my_scene.yaml --out my_arm_c --name my_arm --tick --derivatives",
    )
)
@click.argument("scene", type=SCENE)
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR",
              help="A new or empty folder, or one exported before.")  # fmt: skip
@click.option("--name", metavar="NAME",
              help="Prefix of all functions, a C identifier. [default: from the scene]",
              )  # fmt: skip
@click.option("--tick", is_flag=True, help="Also export the simulator's time step.")
@click.option("--servo", is_flag=True,
              help="Also export the time step and servos that track positions and velocities.",
              )  # fmt: skip
@click.option("--fmu", is_flag=True,
              help="Also make functional mock-up units, by FMI 3.0 and 2.0.")  # fmt: skip
@click.option("--frame", "frames", multiple=True, metavar="FRAME",
              help="Also export pose and Jacobian of this frame; may be repeated.")  # fmt: skip
@click.option("--derivatives", is_flag=True,
              help="Also export derivatives of the dynamics, and of the time step.")  # fmt: skip
@click.option("--float", is_flag=True, hidden=True, expose_value=False, callback=_no_float,
              help="Gone: code is in double precision.")  # fmt: skip
def export(
    scene: str, out: Path, name: str | None, tick: bool, servo: bool, fmu: bool,
    frames: tuple[str, ...], derivatives: bool,
) -> None:  # fmt: skip
    """Write SCENE as a C library into DIR, which needs nothing of the suite.

    DIR contains NAME.h and NAME.c (C11, also C++17), CMakeLists.txt, a test program with the
    numbers that it must give, a description, and the scene. SCENE is the name of a ready scene, or
    a scene file (YAML) or URDF: a path or a package:// URI.
    """
    from arm_sim.export import DERIVATIVES, TERMS
    from arm_sim.export import export as exported

    terms = (*TERMS, *DERIVATIVES) if derivatives else TERMS
    made = exported(scene, out, name, terms, tick or fmu or servo, fmu, frames, servo)
    click.echo(f"{made.folder}: library '{made.name}', {len(made.files)} files")
