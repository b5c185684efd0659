# SPDX-License-Identifier: Apache-2.0
"""The command line of the comparison."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click
from rich.progress import Progress

from arm_sim.cli.output import console, examples, show, table
from benchmarks.controllers.cases import ARMS
from benchmarks.controllers.figures import draw
from benchmarks.controllers.measure import Result, compare, count


@click.command(
    epilog=examples(
        "./arm compare-controllers",
        "./arm compare-controllers --arm two_link --out /tmp/compared",
    ),
)
@click.option(
    "--arm", "arms", multiple=True, type=click.Choice(list(ARMS)),
    help="Arm to compare on; may be repeated. All when omitted.",
)  # fmt: skip
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("compare-controllers"),
    show_default=True, help="Folder for the figures and the numbers.",
)  # fmt: skip
def main(arms: tuple[str, ...], out: Path) -> None:
    """Compare nine controllers on an arm that matches their model, and on three that do not.

    Every controller has the same bandwidth. Tables show, for each case, the errors of the hand,
    overshoot, settling time, effort and energy; figures and all numbers go to a folder.
    """
    chosen = tuple(dict.fromkeys(arms)) or tuple(ARMS)
    screen = console()
    with Progress(console=screen, transient=True) as progress:
        bar = progress.add_task("comparing", total=count(chosen))
        results = compare(chosen, lambda text: progress.update(bar, advance=1, description=text))
    print_tables(results)
    files = [*draw(results, out), _write(results, out / "compare_controllers.json")]
    screen.print("written: " + ", ".join(str(path) for path in files))


def print_tables(results: Sequence[Result]) -> None:
    """Print a table for each arm, task and pace."""
    screen = console()
    for arm, task, pace in dict.fromkeys((r.arm, r.task, r.pace) for r in results):
        screen.print(f"\n{ARMS[arm].title}: {task}, {pace}", style="bold")
        mine = [r for r in results if (r.arm, r.task, r.pace) == (arm, task, pace)]
        order = list(dict.fromkeys(r.controller for r in mine))
        rows = [_row(r) for r in sorted(mine, key=lambda r: order.index(r.controller))]
        show(screen, table(_HEADS, _named_once(rows), text=(0, 1)))


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


def _named_once(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Rows whose first cell is empty where it is that of the row above."""
    above = ["", *(row[0] for row in rows)]
    return [
        ("" if row[0] == name else row[0], *row[1:])
        for row, name in zip(rows, above[:-1], strict=True)
    ]


def _write(results: Sequence[Result], path: Path) -> Path:
    rows = [asdict(r) for r in results]
    for row in rows:
        del row["time"], row["course"]
        if row["settling"] == float("inf"):
            row["settling"] = None
    path.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return path
