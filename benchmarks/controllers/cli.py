# SPDX-License-Identifier: Apache-2.0
"""The command line of the comparison."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click
from rich.console import Console
from rich.progress import track

from arm_dynamics.exceptions import ArmError
from arm_sim.cli.completion import SCENE
from arm_sim.cli.output import console, examples, show, table
from arm_sim.cli.vectors import Vector, VectorType
from benchmarks.controllers.cases import ARMS, PACES, PLANTS, TASKS
from benchmarks.controllers.contenders import contenders
from benchmarks.controllers.figures import draw
from benchmarks.controllers.measure import Result, compare
from benchmarks.controllers.own import arm_of


@click.command(
    epilog=examples(
        "./arm compare-controllers",
        "./arm compare-controllers --arm two_link --out /tmp/compared",
        "./arm compare-controllers ur5e --frame tool0",
        "./arm compare-controllers my_arm.urdf --controller my_package.control:Mine",
    ),
)
@click.argument("scenes", metavar="[SCENE]...", type=SCENE, nargs=-1)
@click.option(
    "--arm", "arms", multiple=True, type=click.Choice(list(ARMS)),
    help="Arm of docs/concepts/control.md; may be repeated.  [default: both]",
)  # fmt: skip
@click.option(
    "--controller", "own", multiple=True, metavar="PACKAGE.MODULE:CLASS",
    help="User-defined controller to compare with the nine; may be repeated.",
)  # fmt: skip
@click.option(
    "--frame", help="Frame of SCENE that follows the line.  [default: the last moving frame]"
)
@click.option(
    "--step", type=VectorType(), metavar='"X Y Z"',
    help="Line from the start, in m, for SCENE.  [default: one that the arm can follow]",
)  # fmt: skip
@click.option(
    "--payload", type=click.FloatRange(0.0, min_open=True),
    help="Payload in kg, for SCENE.  [default: 5 % of the moving mass]",
)  # fmt: skip
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path),
    default=Path("reports/compare-controllers"),
    show_default=True, help="Folder for figures and results.",
)  # fmt: skip
@click.option(
    "--json", "as_json", is_flag=True, help="Print all results as JSON instead of tables."
)
def main(
    scenes: tuple[str, ...],
    arms: tuple[str, ...],
    own: tuple[str, ...],
    frame: str | None,
    step: Vector | None,
    payload: float | None,
    out: Path,
    as_json: bool,
) -> None:
    """Compare nine controllers on an arm that matches their model, and on three that do not.

    Without SCENE, a Panda and a planar 2R arm are used. All controllers have the same bandwidth.
    Tables show, for each case, the errors of the hand, overshoot, settling time, effort and
    energy; figures and all results are written to a folder.
    """
    try:
        chosen = [ARMS[name] for name in dict.fromkeys(arms)]
        chosen += [arm_of(scene, frame, _step(step), payload) for scene in scenes]
        chosen, competing = chosen or list(ARMS.values()), contenders(own)
        total = len(chosen) * len(PLANTS) * len(TASKS) * len(PACES) * len(competing)
        runs = track(compare(chosen, competing), "comparing", total, console=Console(stderr=True),
                     transient=True)  # fmt: skip
        results = list(runs)
    except ArmError as error:
        raise click.ClickException(str(error)) from None
    path = out / "compare_controllers.json"
    files = [*draw(results, out), _write(results, path)]
    if as_json:
        click.echo(path.read_text(encoding="utf-8"))
        return
    print_tables(results)
    console().print("written: " + ", ".join(str(path) for path in files))


def _step(given: Vector | None) -> list[float] | None:
    if given is None:
        return None
    if len(given.rows) != 1 or len(given.rows[0]) != 3:
        raise click.UsageError("--step: 3 numbers are expected, x y z in m")
    return list(given.rows[0])


def print_tables(results: Sequence[Result]) -> None:
    screen = console()
    for title, task, pace in dict.fromkeys((r.title, r.task, r.pace) for r in results):
        screen.print(f"\n{title}: {task}, {pace}", style="bold")
        mine = [r for r in results if (r.title, r.task, r.pace) == (title, task, pace)]
        order = list(dict.fromkeys(r.controller for r in mine))
        rows = [_row(r) for r in sorted(mine, key=lambda r: order.index(r.controller))]
        show(screen, table(_HEADS, rows, text=(0, 1)))


_HEADS = (
    "controller", "plant", "max error [mm]", "off line [mm]", "final [mm]", "overshoot [%]",
    "settling [s]", "effort [N m]", "energy [J]", "at limit [%]",
)  # fmt: skip


def _row(r: Result) -> tuple[str, ...]:
    aside = "-" if r.aside is None else f"{r.aside:.3f}"
    settling = "never" if r.settling == float("inf") else f"{r.settling:.2f}"
    numbers = f"{r.final:.3f}", f"{r.overshoot:.1f}", settling, f"{r.effort:.1f}"
    ends = f"{r.energy:.2f}", f"{r.saturated:.0f}"
    return r.controller, r.plant, f"{r.error:.3f}", aside, *numbers, *ends


def _write(results: Sequence[Result], path: Path) -> Path:
    rows = [asdict(r) for r in results]
    for row in rows:
        del row["time"], row["course"]
        if row["settling"] == float("inf"):
            row["settling"] = None
    path.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return path
