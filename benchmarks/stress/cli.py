# SPDX-License-Identifier: Apache-2.0
"""The command line of the stability stress."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from benchmarks.reporting.progress import Bar
from benchmarks.stress import together
from benchmarks.stress.page import write
from benchmarks.stress.survey import Found, Plan, survey
from benchmarks.stress.tables import runs, wrong
from benchmarks.stress.together import MUJOCO, OURS
from benchmarks.stress.verdict import FORBIDDEN, OUTCOMES

ROOT = Path(__file__).parents[2]
QUICK_JOINTS = 6
RUNS = 5  # of each set of features
EXAMPLES = """\b
Examples:
  ./arm stress                       some two thousand runs of random arms, as many of features
  ./arm stress --quick               arms of few joints, sixty runs of features; a few minutes
  ./arm stress --seed 1000           others
  ./arm stress --only arms --seed 17 --runs 1        one arm again, with every method and step
  ./arm stress --only features --seed 17 --runs 5    one set of features again
  ./arm stress --docs                also renews docs/laboratory/stability.md
"""


@click.command(epilog=EXAMPLES)
@click.option(
    "--runs", "wanted", type=click.IntRange(1),
    help="About how many of each kind: rounded up to whole arms and scenes. [default: 2016 and "
    "2000; with --quick 392 and 60]",
)  # fmt: skip
@click.option(
    "--only",
    type=click.Choice(["arms", "features"]),
    default=None,
    help="Extreme arms, or random sets of features on ordinary ones. [default: both]",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True,
              help="Seed of the first arm and scene; later ones count up.")  # fmt: skip
@click.option("--quick", is_flag=True, help=f"Arms of at most {QUICK_JOINTS} joints, fewer runs.")
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(),
              show_default="one for each core", help="Number of processes.")  # fmt: skip
@click.option(
    "--backend", default="auto", show_default=True, type=click.Choice(["auto", "native", "vm"]),
    help="For arms: compiled code, or CasADi's virtual machine. Features need compiled code.",
)  # fmt: skip
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), default=ROOT / "benchmarks/results",
    show_default="benchmarks/results",
    help="Folder for stability.md, stability*.json and figures/stability.png.",
)  # fmt: skip
@click.option("--docs", is_flag=True, help="Also update the page in docs/laboratory.")
def main(
    wanted: int | None, only: str | None, seed: int, quick: bool, workers: int, backend: str,
    out: Path, docs: bool,
) -> None:  # fmt: skip
    """Does anything fail without saying so? Random arms at their worst, by every method and step.

    Trees of 1 to 30 joints, masses from 1 g to 1 t, links from 1 mm to 10 m, needles, speeds up to
    100 rad/s, torques without measure, stiff and dry friction, ticks from 10 µs to 10 ms. Then
    random sets of features on ordinary arms, next to MuJoCo if that is installed (./arm bench does
    it). Each run is compared with a run under tight error control. Ends with an error if a run is
    wrong without saying so.
    """
    console, pages = Console(stderr=True), ROOT / "docs/laboratory" if docs else None
    bad = False
    if only != "features":
        plan = Plan(backend=backend)
        plan = replace(plan, most_joints=QUICK_JOINTS) if quick else plan
        arms = ceil((wanted or (392 if quick else 2016)) / len(plan.settings()))
        found = examined(range(seed, seed + arms), plan, min(workers, arms), console)
        path = write(found, plan, seed, out, pages)
        Console().print(summary(runs(found), OUTCOMES))
        Console().print(wrong(found))
        click.echo(f"report: {path}")
        bad |= any(r.outcome in FORBIDDEN for one in found for r in one.results)
    if only != "arms":
        scenes = ceil((wanted or (60 if quick else 2000)) / RUNS)
        seeds = range(seed, seed + scenes)
        results = driven(seeds, min(wanted or RUNS, RUNS), min(workers, scenes), console)
        path = together.write(results, out, pages)
        for program in (OURS, MUJOCO):
            if mine := together.tables.of(results, program):
                Console().print(summary(mine, together.OUTCOMES, program))
        Console().print(together.tables.wrong(results))
        click.echo(f"report: {path}")
        bad |= any(r.outcome in together.FORBIDDEN for r in results if r.program == OURS)
    sys.exit(bad)


def examined(seeds: range, plan: Plan, workers: int, console: Console) -> list[Found]:
    """Examine the arms with a progress bar; the answer is in the order of the seeds."""
    found = []
    with Bar(console) as bar:
        bar.stage("random arms", len(seeds))
        for one in survey(seeds, plan, workers):
            found.append(one)
            bar.advance()
    return sorted(found, key=lambda one: one.seed)


def driven(seeds: range, each: int, workers: int, console: Console) -> list[together.Result]:
    """Run the sets of features with a progress bar; the answer is in the order of the seeds."""
    found = []
    with Bar(console) as bar:
        bar.stage("random sets of features", len(seeds))
        for one in together.survey(seeds, each, workers):
            found += one
            bar.advance()
    return sorted(found, key=lambda result: (result.seed, result.run, result.program))


def summary(results: Sequence[Any], outcomes: Sequence[str], title: str | None = None) -> Table:
    """Outcomes, for the terminal."""
    count = Counter(r.outcome for r in results)
    table = Table("runs", *outcomes, title=title)
    table.add_row(str(count.total()), *(str(count[name]) for name in outcomes))
    return table
