# SPDX-License-Identifier: Apache-2.0
"""``./arm export``: a scene as a C library that needs nothing of the suite."""

from pathlib import Path
from typing import Annotated

import click

from arm_sim.cli.arguments import Scene
from arm_sim.cli.command import command


@command(
    "./arm export panda --out panda_c",
    "./arm export panda --out panda_fmu --fmu",
    "./arm export my_arm.urdf --out my_arm_c --name my_arm --frame tool",
    "./arm export my_scene.yaml --out my_arm_c --name my_arm --tick --derivatives",
)
def export(
    scene: Scene,
    *,
    out: Annotated[Path, "--out DIR"],
    name: Annotated[str | None, "--name NAME"] = None,
    tick: bool = False,
    servo: bool = False,
    fmu: bool = False,
    frames: Annotated[tuple[str, ...], "--frame FRAME"] = (),
    derivatives: bool = False,
) -> None:
    """Write SCENE as a C library into DIR, which needs nothing of the suite.

    DIR contains NAME.h and NAME.c (C11, also C++17), CMakeLists.txt, a test program with the
    numbers that it must give, a description, and the scene. SCENE is the name of a bundled scene,
    or a scene file (YAML) or URDF: a path or a package:// URI.

    Args:
        out: A new or empty folder, or one exported before.
        name: Prefix of all functions, a C identifier. [default: from the scene]
        tick: Also export the simulator's time step.
        servo: Also export the time step and servos that track positions and velocities.
        fmu: Also make functional mock-up units, by FMI 3.0 and 2.0.
        frames: Also export pose and Jacobian of this frame; may be repeated.
        derivatives: Also export derivatives of the dynamics, and of the time step.
    """
    from arm_sim.export import DERIVATIVES, TERMS
    from arm_sim.export import export as export_library

    terms = (*TERMS, *DERIVATIVES) if derivatives else TERMS
    library = export_library(scene, out, name, terms, tick or fmu or servo, fmu, frames, servo)
    click.echo(f"{library.folder}: library '{library.name}', {len(library.files)} files")
