# SPDX-License-Identifier: Apache-2.0
"""``./arm excite``: compute a motion from which masses and friction can be identified."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import click

from arm_dynamics.writing import warn_if_replaced
from arm_sim.cli import arguments
from arm_sim.cli.command import command
from arm_sim.cli.output import console, facts, limit, number, progress, say, table, to_json
from arm_sim.cli.vectors import Vector, VectorType

if TYPE_CHECKING:
    from arm_studies.identification.excitation import Excitation, Room

BOX = VectorType('"X Y Z X Y Z"', 6, "x y z of two opposite corners in m")
POSITION = VectorType('"Q …"')


@command(
    "./arm excite panda",
    "./arm excite panda --aim masses --acceleration 10",
    "./arm excite ur10 --acceleration 4 --period 20 --turns 2 --out exciting.yaml",
    './arm excite panda --frame panda_hand --box "0.1 -0.6 0.2 0.8 0.6 1.0"',
    "./arm go --trajectory exciting.yaml",
)
def excite(
    scene: arguments.Scene,
    *,
    out: arguments.YamlFile | None = None,
    figure: arguments.Figure | None = None,
    period: arguments.Seconds = 10.0,
    turns: Annotated[int, click.IntRange(1, 100)] = 1,
    harmonics: Annotated[int, click.IntRange(2, 30)] = 5,
    aim: Literal["all", "masses"] = "all",
    acceleration: arguments.Positive | None = None,
    share: arguments.Share = 0.8,
    margin: Annotated[float, click.FloatRange(0.0, 0.49)] = 0.05,
    box: Annotated[Vector | None, BOX] = None,
    frames: Annotated[tuple[str, ...], "--frame"] = (),
    clearance: arguments.NotNegative = 0.05,
    start: Annotated[Vector | None, POSITION] = None,
    attempts: Annotated[int, click.IntRange(1, 1000)] = 3,
    seed: int = 0,
    as_json: arguments.Json = False,
) -> None:
    """Compute a motion of SCENE from which its masses and friction can be identified.

    The motion is a Fourier series from rest to rest that maximizes the determinant of the
    information matrix (D-optimal); with --aim masses it minimizes the sum of the variances of the
    masses (A-optimal). It respects the limits of position, velocity, acceleration and torque,
    stays in the box and keeps clear of contact planes. Collisions between links are NOT checked:
    inspect the motion with ./arm view before running it on an arm.

    Args:
        out: Trajectory to write (.yaml).  [default: exciting.yaml]
        figure: Figure to write (.png, .pdf or .svg).  [default: beside the trajectory]
        period: Duration of one period in s.
        turns: Number of periods in the file.
        harmonics: Number of harmonics of the Fourier series.
        aim: Parameters to optimize for: all of them, or the masses.
        acceleration: Largest acceleration in rad/s² or m/s².  [default: no limit]
        share: Fraction of the velocity and torque limits that may be used.
        margin: Distance to both position limits, as a fraction of the range.
        box: Two opposite corners, in m, of a box that --frame must stay in.
        frames: Frame that must stay in --box; may be repeated.
        clearance: Distance in m to keep from the planes of the scene's contacts.
        start: Joint positions at both ends in rad or m.  [default: scene]
        attempts: Number of random starts of the optimization.
        seed: Seed of the random starts.
    """
    if bool(frames) != (box is not None):
        raise click.UsageError("--box and --frame must be given together")
    from arm_dynamics import Dynamics
    from arm_dynamics.trajectory import JointTrajectory
    from arm_studies.identification import excitation
    from arm_studies.identification.figures import draw_excitation

    dynamics = Dynamics(scene)
    inside = excitation.Box(box.rows[0][:3], box.rows[0][3:], frames) if box else None
    begin = start.flat(dynamics.joint_names) if start else None
    most = math.inf if acceleration is None else acceleration
    room = excitation.Room(dynamics, share, margin, most, inside, clearance, begin)

    def in_lines(completed: int, **_: object) -> None:
        click.echo(f"{completed} of {attempts} attempts", err=True)

    if not sys.stderr.isatty():
        click.echo(f"searching: {attempts} attempts, a few seconds each", err=True)
    with progress(sys.stderr, in_lines, description="searching", total=attempts) as bar:
        best = excitation.excite(
            room, period=period, harmonics=harmonics, aim=aim, attempts=attempts, seed=seed,
            on_progress=lambda done: bar(completed=done),
        )  # fmt: skip
    out = out or Path("exciting.yaml")
    JointTrajectory.of(best.motion, best.joint_names, turns).save(out)
    figure = figure or out.with_suffix(".png")
    warn_if_replaced(figure)
    draw_excitation(best.motion, room, figure)
    if as_json:
        names = ("condition", "information", "masses", "parameters", "attempts")
        result = {name: getattr(best, name) for name in names}
        files = {"trajectory": out, "figure": figure}
        click.echo(to_json(result | {"duration": best.motion.duration} | files))
        return
    _show(best, room)
    say(out, figure)


def _show(best: Excitation, room: Room) -> None:
    import numpy as np

    _, q, v, a = best.motion.table(np.linspace(0.0, 1.0, 10))
    speed, acceleration, effort = (
        abs(values).max(axis=0) for values in (v, a, room.torques(q, v, a))
    )
    columns = ("joint", "from", "to", "speed", "allowed", "acceleration", "effort", "allowed")
    rows = [
        (name, number(q[:, i].min(), 3), number(q[:, i].max(), 3),
         number(speed[i], 3), limit(room.limits.velocity[i], 3),
         number(acceleration[i], 3), number(effort[i], 3), limit(room.effort[i], 3))
        for i, name in enumerate(best.joint_names)
    ]  # fmt: skip
    moved = [
        f"{name} {number(q0, 4)} → {number(start, 4)}"
        for name, q0, start in zip(best.joint_names, room.model.q0, room.start, strict=True)
        if q0 != start
    ]
    gain = "log det" if best.masses is None else "mean of masses"
    remarks = [
        ("start", f"not the scene's: {', '.join(moved)}" if moved else "the scene's"),
        ("period", f"{best.motion.duration:g} s, from rest to rest"),
        ("parameters", f"{best.parameters} identifiable, including drive inertia, viscous and "
                       "Coulomb friction and an offset of each joint"),
        ("condition", f"{best.condition:.3g}, with columns scaled by those of random motions"),
    ]  # fmt: skip
    if best.masses is not None:  # the motion was optimized for them
        bodies = zip(list(room.model.pin.names)[1:], best.masses, strict=True)
        each = ", ".join(f"{name} {deviation:.2%}" for name, deviation in bodies)
        remarks.append(("masses", "standard deviations after one period, with 5 % of noise at "
                                  f"1 kHz and the total mass known: {each}"))  # fmt: skip
    remarks += [
        ("attempts", f"{gain} {', '.join(f'{x:.4g}' for x in best.attempts)}"),
        ("not checked", "collisions between links"),
    ]
    say(table(columns, rows))
    console().print(facts(remarks))
