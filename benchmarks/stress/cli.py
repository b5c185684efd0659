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

import click
from rich.console import Console
from rich.table import Table

from benchmarks.reporting.progress import Bar
from benchmarks.stress.page import write
from benchmarks.stress.survey import Found, Plan, survey
from benchmarks.stress.tables import runs, wrong
from benchmarks.stress.verdict import FORBIDDEN, OUTCOMES

ROOT = Path(__file__).parents[2]
QUICK_JOINTS = 6
EXAMPLES = """\b
Examples:
  ./arm stress                       some two thousand runs; under ten minutes on two cores
  ./arm stress --quick               arms of few joints; under a minute
  ./arm stress --seed 1000           other arms
  ./arm stress --seed 17 --runs 1    one arm again, with every method and step
  ./arm stress --docs                also renews docs/stability.md
"""


@click.command(epilog=EXAMPLES)
@click.option(
    "--runs", "wanted", type=click.IntRange(1),
    help="About how many: rounded up to whole arms. [default: 2016; with --quick 392]",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True,
              help="Of the first arm; the next have the next seeds.")  # fmt: skip
@click.option("--quick", is_flag=True, help=f"Arms of at most {QUICK_JOINTS} joints, fewer runs.")
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(),
              show_default="one for each core", help="Processes.")  # fmt: skip
@click.option(
    "--backend", default="auto", show_default=True, type=click.Choice(["auto", "native", "vm"]),
    help="Compiled code, or CasADi's virtual machine.",
)  # fmt: skip
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), default=ROOT / "benchmarks/results",
    show_default="benchmarks/results",
    help="Folder for stability.md, stability.json and figures/stability.png.",
)  # fmt: skip
@click.option("--docs", is_flag=True, help="Also renew docs/stability.md and its figure.")
def main(
    wanted: int | None, seed: int, quick: bool, workers: int, backend: str, out: Path, docs: bool
) -> None:
    """Does anything fail without saying so? Random arms at their worst, by every method and step.

    Trees of 1 to 30 joints, masses from 1 g to 1 t, links from 1 mm to 10 m, needles, speeds up to
    100 rad/s, torques without measure, stiff and dry friction, ticks from 10 µs to 10 ms. Each run
    is compared with a run under tight error control. Ends with an error if a run is wrong without
    saying so.
    """
    plan = Plan(backend=backend)
    plan = replace(plan, most_joints=QUICK_JOINTS) if quick else plan
    arms = ceil((wanted or (392 if quick else 2016)) / len(plan.settings()))
    found = examined(range(seed, seed + arms), plan, min(workers, arms), Console(stderr=True))
    path = write(found, plan, seed, out, ROOT / "docs" if docs else None)
    console = Console()
    console.print(summary(found))
    console.print(wrong(found))
    click.echo(f"report: {path}")
    sys.exit(any(r.outcome in FORBIDDEN for one in found for r in one.results))


def examined(seeds: range, plan: Plan, workers: int, console: Console) -> list[Found]:
    """Examine the arms with a progress bar; the answer is in the order of the seeds."""
    found = []
    with Bar(console) as bar:
        bar.stage("random arms", len(seeds))
        for one in survey(seeds, plan, workers):
            found.append(one)
            bar.advance()
    return sorted(found, key=lambda one: one.seed)


def summary(found: Sequence[Found]) -> Table:
    """Outcomes, for the terminal."""
    count = Counter(r.outcome for r in runs(found))
    table = Table("arms", "runs", *OUTCOMES)
    table.add_row(str(len(found)), str(count.total()), *(str(count[name]) for name in OUTCOMES))
    return table
