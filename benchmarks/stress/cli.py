# SPDX-License-Identifier: Apache-2.0
"""The command line of the stability stress."""

import os
import sys
from collections import Counter
from itertools import islice
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from benchmarks.reporting.progress import Bar
from benchmarks.stress.holding import Held, measured, summary
from benchmarks.stress.judge import FORBIDDEN, OUTCOMES, Result
from benchmarks.stress.report import write, wrong
from benchmarks.stress.scenes import KINDS, MOST_JOINTS
from benchmarks.stress.survey import survey

ROOT = Path(__file__).parents[2]
QUICK_JOINTS = 6
SCENES, QUICK_SCENES = 40, 4
SHARE = 0.1  # of the scenes with features that the independent simulator solves, too
EXAMPLES = """\b
Examples:
  ./arm stress                       over two thousand runs, in an hour
  ./arm stress --quick               arms of few joints, some 200 runs; some minutes
  ./arm stress --seed 1000           others
  ./arm stress --only features --seed 17 --scenes 1    one scene again, in all its ways
"""


@click.command(epilog=EXAMPLES)
@click.option(
    "--scenes", "wanted", type=click.IntRange(1),
    help=f"How many of each kind. [default: {SCENES}; with --quick {QUICK_SCENES}]",
)  # fmt: skip
@click.option(
    "--only", type=click.Choice([*KINDS, "held"]), default=None,
    help="Extreme arms, features on ordinary ones, or sets that hold together. [default: all]",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True,
              help="Seed of the first scene; later ones count up.")  # fmt: skip
@click.option(
    "--quick", is_flag=True, help=f"Arms of at most {QUICK_JOINTS} joints, fewer scenes."
)
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(),
              show_default="one for each core", help="Number of processes.")  # fmt: skip
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), default=ROOT / "benchmarks/results",
    show_default="benchmarks/results", help="Folder for stability.md and its figure and data.",
)  # fmt: skip
def main(
    wanted: int | None, only: str | None, seed: int, quick: bool, workers: int, out: Path
) -> None:  # fmt: skip
    """Does anything fail without saying so? Random scenes at their worst, by all methods.

    Trees of 1 to 30 joints, masses from 1 g to 1 t, needles, torques without measure; ordinary
    arms with stops, friction, drives, cords and contact, stiff and soft; joints and contacts that
    hold together in many ways. Each run is compared with one in short ticks under tight error
    control, some with an independent simulator, loads with linear programs. Ends with an error if
    a run is wrong without saying so.
    """
    scenes = wanted or (QUICK_SCENES if quick else SCENES)
    joints = QUICK_JOINTS if quick else MOST_JOINTS
    work = [
        (kind, k, joints, SHARE if kind == "features" else 0.0)
        for kind in KINDS
        if only in (None, kind)
        for k in range(seed, seed + scenes)
    ]
    every, held = list[Result](), list[Held]()
    with Bar(Console(stderr=True)) as bar:
        bar.stage("random scenes", len(work))
        for results in survey(work, min(workers, scenes)):
            every += results
            bar.done()
        if only in (None, "held"):
            bar.stage("sets that hold together", scenes)
            for one in islice(measured(seed), scenes):
                held.append(one)
                bar.done()
    every.sort(key=lambda r: (r.kind, r.seed))
    if held:
        Console().print(summary(held))
    if every:
        count = Counter(r.outcome for r in every)
        table = Table("runs", *OUTCOMES)
        table.add_row(str(len(every)), *(str(count[name]) for name in OUTCOMES))
        Console().print(table)
        Console().print(wrong(every))
        path = write(every, held, out)
        click.echo(f"report: {path}")
    sys.exit(any(r.outcome in FORBIDDEN for r in every) or not all(one.good for one in held))
