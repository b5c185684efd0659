# SPDX-License-Identifier: Apache-2.0
"""``./arm excite``: a motion from which an arm's masses and friction can be found."""

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
    from arm_dynamics.identification.excitation import Excitation, Room

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
@click.option("--out", type=_FILE, help="Where the motion goes; .yaml.  [default: exciting.yaml]")
@click.option("--figure", type=_FILE, help="Where its figure goes; .png, .pdf or .svg.  "
              "[default: beside the motion]")  # fmt: skip
@click.option("--period", default=10.0, show_default=True, help="In s.",
              type=click.FloatRange(0.0, 3600.0, min_open=True))  # fmt: skip
@click.option("--turns", default=1, show_default=True, type=click.IntRange(1, 100),
              help="Periods in the file.")  # fmt: skip
@click.option("--harmonics", default=5, show_default=True, type=click.IntRange(2, 30),
              help="The highest harmonic of the motion.")  # fmt: skip
@click.option("--aim", type=click.Choice(["all", "masses"]), default="all", show_default=True,
              help="What it tells: all parameters alike, or masses above all.")  # fmt: skip
@click.option("--acceleration", type=click.FloatRange(0.0, min_open=True), default=math.inf,
              help="Largest acceleration in rad/s² or m/s².  [default: no limit]")  # fmt: skip
@click.option("--share", default=0.8, show_default=True, type=_SHARE,
              help="Of the limits of speed and torque that may be used.")  # fmt: skip
@click.option("--margin", default=0.05, show_default=True, type=click.FloatRange(0.0, 0.49),
              help="Share of its range that a joint stays away from both its limits.")  # fmt: skip
@click.option("--box", type=VectorType(), metavar='"X Y Z X Y Z"',
              help="Two corners in m between which frames stay.")  # fmt: skip
@click.option("--frame", "frames", multiple=True,
              help="Frame that --box is for; may be given again.")  # fmt: skip
@click.option("--clearance", default=0.05, show_default=True, type=click.FloatRange(0.0),
              help="Distance in m to keep from planes of the scene's contacts.")  # fmt: skip
@click.option("--start", type=VectorType(), metavar='"Q …"',
              help="Where it begins and ends.  [default: as the scene]")  # fmt: skip
@click.option("--attempts", default=3, show_default=True, type=click.IntRange(1, 1000),
              help="Random starts of the search.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, help="Of the random starts.")
@click.option("--json", "as_json", is_flag=True, help="Print the result for scripts.")
def excite(
    scene: str, out: Path | None, figure: Path | None, period: float, turns: int, harmonics: int,
    aim: str, acceleration: float, share: float, margin: float, box: Vector | None,
    frames: tuple[str, ...], clearance: float, start: Vector | None, attempts: int, seed: int,
    as_json: bool,
) -> None:  # fmt: skip
    """Find a motion of SCENE from which its masses and friction can be identified.

    A periodic motion (Fourier series) from rest to rest that tells as much as possible of the
    parameters: the determinant of its information matrix is largest. With --aim masses the sum of
    the masses' variances is least. It keeps to the limits of position, speed, acceleration and
    torque, stays in the box and off planes. That links do not
    strike one another is not looked at: look at the motion (./arm view) before an arm makes it.
    """
    out = out or Path("exciting.yaml")
    if out.suffix not in (".yaml", ".yml"):
        raise click.UsageError(f"--out: '{out}'; a file .yaml is expected")
    if bool(frames) != (box is not None):
        raise click.UsageError("--box and --frame go together: a box is for frames")
    from arm_dynamics import Dynamics
    from arm_dynamics.identification.excitation import Room
    from arm_dynamics.identification.excitation import excite as found
    from arm_dynamics.trajectory import JointTrajectory

    room = Room(
        Dynamics(scene), share, margin, acceleration, _box(box, frames), clearance, _start(start)
    )
    with _progress(attempts) as told:
        best = found(
            room, period=period, harmonics=harmonics, aim=aim, attempts=attempts, seed=seed,
            told=told,
        )  # fmt: skip
    JointTrajectory.of(best.motion, best.joint_names, turns).save(out)
    figure = figure or out.with_suffix(".png")
    from arm_sim.cli.identification.excitation_figure import draw

    draw(best.motion, room, figure)
    if as_json:
        click.echo(json.dumps(_result(best, out, figure)))
        return
    _show(best, room)
    console().print(f"{out}\n{figure}", markup=False)


def _box(corners: Vector | None, frames: tuple[str, ...]) -> Any:
    from arm_dynamics.identification.excitation import Box

    if corners is None:
        return None
    numbers = list(corners.rows[0]) if len(corners.rows) == 1 else []
    if len(numbers) != 6:
        raise click.UsageError("--box: 6 numbers are expected, x y z of two corners in m")
    return Box(numbers[:3], numbers[3:], frames)


def _start(given: Vector | None) -> Any:
    return None if given is None else given.rows[0]


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
    moved = [
        f"{name} {number(q0, 4)} → {number(start, 4)}"
        for name, q0, start in zip(best.joint_names, room.model.q0, room.start, strict=True)
        if q0 != start
    ]
    out.print(facts([
        ("start", f"not the scene's: {', '.join(moved)}" if moved else "the scene's"),
        ("period", f"{best.motion.duration:g} s, from rest to rest"),
        ("parameters", f"{best.parameters} told apart, with drive inertia, viscous and Coulomb "
                       "friction and an offset of each joint"),
        ("condition", f"{best.condition:.3g}, columns scaled as those of random motions"),
        *_masses(best, room),
        ("attempts", f"{'log det' if best.masses is None else 'mean of masses'} "
                     f"{', '.join(f'{x:.4g}' for x in best.attempts)}"),
        ("not looked at", "whether links strike one another"),
    ]))  # fmt: skip


def _masses(best: Excitation, room: Room) -> list[tuple[str, str]]:
    """How sure masses will be, where they are the aim."""
    if best.masses is None:
        return []
    names = list(room.model.pin.names)[1:]
    told = ", ".join(f"{n} {s:.2%}" for n, s in zip(names, best.masses, strict=True))
    return [("masses", f"standard deviations after one period, with 5 % of noise at 1 kHz and the "
                       f"total known: {told}")]  # fmt: skip


@contextmanager
def _progress(attempts: int) -> Iterator[Callable[[int], None]]:
    """Show how many attempts are done, where somebody looks."""
    if not sys.stderr.isatty():
        click.echo(f"searching: {attempts} attempts, some seconds each", err=True)
        yield lambda done: click.echo(f"{done} of {attempts} attempts", err=True)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("searching", total=attempts)
        yield lambda done: progress.update(task, completed=done)
