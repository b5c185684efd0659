# SPDX-License-Identifier: Apache-2.0
"""``./arm excite``: compute a motion from which masses and friction can be identified."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import console, examples, facts, limit, number, show, table
from arm_sim.cli.vectors import Vector, VectorType

if TYPE_CHECKING:
    from arm_studies.identification.excitation import Excitation, Room

_FILE = click.Path(dir_okay=False, path_type=Path)
_SHARE = click.FloatRange(0.0, 1.0, min_open=True)


@click.command(
    epilog=examples(
        "./arm excite panda",
        "./arm excite panda --aim masses --acceleration 10",
        "./arm excite ur10 --acceleration 4 --period 20 --turns 2 --out exciting.yaml",
        './arm excite panda --frame panda_hand --box "0.1 -0.6 0.2 0.8 0.6 1.0"',
        "./arm go --trajectory exciting.yaml",
    )
)
@click.argument("scene", type=SCENE)
@click.option("--out", type=_FILE,
              help="Trajectory to write (.yaml).  [default: exciting.yaml]")  # fmt: skip
@click.option("--figure", type=_FILE, help="Figure to write (.png, .pdf or .svg).  "
              "[default: beside the trajectory]")  # fmt: skip
@click.option("--period", default=10.0, show_default=True, help="Duration of one period in s.",
              type=click.FloatRange(0.0, 3600.0, min_open=True))  # fmt: skip
@click.option("--turns", default=1, show_default=True, type=click.IntRange(1, 100),
              help="Number of periods in the file.")  # fmt: skip
@click.option("--harmonics", default=5, show_default=True, type=click.IntRange(2, 30),
              help="Number of harmonics of the Fourier series.")  # fmt: skip
@click.option("--aim", type=click.Choice(["all", "masses"]), default="all", show_default=True,
              help="Parameters to optimize for: all of them, or the masses.")  # fmt: skip
@click.option("--acceleration", type=click.FloatRange(0.0, min_open=True), default=math.inf,
              help="Largest acceleration in rad/s² or m/s².  [default: no limit]")  # fmt: skip
@click.option("--share", default=0.8, show_default=True, type=_SHARE,
              help="Fraction of the velocity and torque limits that may be used.")  # fmt: skip
@click.option("--margin", default=0.05, show_default=True, type=click.FloatRange(0.0, 0.49),
              help="Distance to both position limits, as a fraction of the range.")  # fmt: skip
@click.option("--box", type=VectorType(), metavar='"X Y Z X Y Z"',
              help="Two opposite corners, in m, of a box that --frame must stay in.")  # fmt: skip
@click.option("--frame", "frames", multiple=True,
              help="Frame that must stay in --box; may be repeated.")  # fmt: skip
@click.option("--clearance", default=0.05, show_default=True, type=click.FloatRange(0.0),
              help="Distance in m to keep from the planes of the scene's contacts.")  # fmt: skip
@click.option("--start", type=VectorType(), metavar='"Q …"',
              help="Joint positions at both ends in rad or m.  [default: scene]")  # fmt: skip
@click.option("--attempts", default=3, show_default=True, type=click.IntRange(1, 1000),
              help="Number of random starts of the optimization.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, help="Seed of the random starts.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def excite(
    scene: str, out: Path | None, figure: Path | None, period: float, turns: int, harmonics: int,
    aim: str, acceleration: float, share: float, margin: float, box: Vector | None,
    frames: tuple[str, ...], clearance: float, start: Vector | None, attempts: int, seed: int,
    as_json: bool,
) -> None:  # fmt: skip
    """Compute a motion of SCENE from which its masses and friction can be identified.

    The motion is a Fourier series from rest to rest that maximizes the determinant of the
    information matrix (D-optimal); with --aim masses it minimizes the sum of the variances of the
    masses (A-optimal). It respects the limits of position, velocity, acceleration and torque,
    stays in the box and keeps clear of contact planes. Collisions between links are NOT checked:
    inspect the motion with ./arm view before running it on an arm.
    """
    out = _motion_file(out)
    if bool(frames) != (box is not None):
        raise click.UsageError("--box and --frame must be given together")
    from arm_dynamics import Dynamics
    from arm_dynamics.trajectory import JointTrajectory
    from arm_studies.identification.excitation import Room
    from arm_studies.identification.excitation import excite as found

    begin = None if start is None else start.rows[0]
    room = Room(Dynamics(scene), share, margin, acceleration, _box(box, frames), clearance, begin)
    with _progress(attempts) as report:
        best = found(
            room, period=period, harmonics=harmonics, aim=aim, attempts=attempts, seed=seed,
            told=report,
        )  # fmt: skip
    JointTrajectory.of(best.motion, best.joint_names, turns).save(out)
    figure = figure or out.with_suffix(".png")
    from arm_studies.cli.excitation_figure import draw

    draw(best.motion, room, figure)
    if as_json:
        click.echo(json.dumps(_result(best, out, figure)))
        return
    _show(best, room)
    console().print(f"{out}\n{figure}", markup=False)


def _box(corners: Vector | None, frames: tuple[str, ...]) -> Any:
    from arm_studies.identification.excitation import Box

    if corners is None:
        return None
    numbers = list(corners.rows[0]) if len(corners.rows) == 1 else []
    if len(numbers) != 6:
        raise click.UsageError(
            f"--box: {len(numbers)} numbers; 6 are expected, x y z of two opposite corners in m"
        )
    return Box(numbers[:3], numbers[3:], frames)


def _result(best: Excitation, out: Path, figure: Path) -> dict[str, Any]:
    return {
        "condition": best.condition, "information": best.information,
        "masses": None if best.masses is None else best.masses.tolist(),
        "parameters": best.parameters, "attempts": best.attempts.tolist(),
        "duration": best.motion.duration, "trajectory": str(out), "figure": str(figure),
    }  # fmt: skip


def _show(best: Excitation, room: Room) -> None:
    import numpy as np

    _, q, v, a = best.motion.table(np.linspace(0.0, 1.0, 10))
    tau = room.torques(q, v, a)
    columns = ("joint", "from", "to", "speed", "allowed", "acceleration", "effort", "allowed")
    rows = [
        (name, number(q[:, i].min(), 3), number(q[:, i].max(), 3),
         number(abs(v[:, i]).max(), 3), limit(room.limits.velocity[i], 3),
         number(abs(a[:, i]).max(), 3), number(abs(tau[:, i]).max(), 3), limit(room.effort[i], 3))
        for i, name in enumerate(best.joint_names)
    ]  # fmt: skip
    out = console()
    show(out, table(columns, rows))
    out.print(facts([
        ("start", _start_words(best, room)),
        ("period", f"{best.motion.duration:g} s, from rest to rest"),
        ("parameters", f"{best.parameters} identifiable, including drive inertia, viscous and "
                       "Coulomb friction and an offset of each joint"),
        ("condition", f"{best.condition:.3g}, with columns scaled by those of random motions"),
        *_masses(best, room),
        ("attempts", f"{'log det' if best.masses is None else 'mean of masses'} "
                     f"{', '.join(f'{x:.4g}' for x in best.attempts)}"),
        ("not checked", "collisions between links"),
    ]))  # fmt: skip


def _motion_file(out: Path | None) -> Path:
    out = out or Path("exciting.yaml")
    if out.suffix not in (".yaml", ".yml"):
        raise click.UsageError(f"--out: '{out}'; a .yaml file is expected")
    return out


def _start_words(best: Excitation, room: Room) -> str:
    moved = [
        f"{name} {number(q0, 4)} → {number(start, 4)}"
        for name, q0, start in zip(best.joint_names, room.model.q0, room.start, strict=True)
        if q0 != start
    ]
    return f"not the scene's: {', '.join(moved)}" if moved else "the scene's"


def _masses(best: Excitation, room: Room) -> list[tuple[str, str]]:
    """Expected standard deviations of the masses, if the motion was optimized for them."""
    if best.masses is None:
        return []
    names = list(room.model.pin.names)[1:]
    each = ", ".join(f"{n} {s:.2%}" for n, s in zip(names, best.masses, strict=True))
    return [("masses", f"standard deviations after one period, with 5 % of noise at 1 kHz and the "
                       f"total mass known: {each}")]  # fmt: skip


@contextmanager
def _progress(attempts: int) -> Iterator[Callable[[int], None]]:
    """Show how many attempts are done: as a bar on a terminal, else line by line."""
    if not sys.stderr.isatty():
        click.echo(f"searching: {attempts} attempts, a few seconds each", err=True)
        yield lambda done: click.echo(f"{done} of {attempts} attempts", err=True)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("searching", total=attempts)
        yield lambda done: progress.update(task, completed=done)
