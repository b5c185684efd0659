# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.missed_events``: does a motion pass over events and say nothing?"""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.missed_events.judge import (
    MAGNIFIED,
    MISSED,
    OUTCOMES,
    REFUSED,
    RIGHT,
    SAME,
    UNSTEADY,
    Result,
    examine,
)
from benchmarks.reporting.progress import Bar

ROOT = Path(__file__).parents[2]
OTHERS = (RIGHT, UNSTEADY, REFUSED, SAME)  # than wrong runs
EXAMPLES = """\b
Examples:
  ./arm python -m benchmarks.missed_events                     five hundred random scenes
  ./arm python -m benchmarks.missed_events --blind             with a guard switched off in each
  ./arm python -m benchmarks.missed_events --seed 17 --runs 1  one of them again
"""


@click.command(epilog=EXAMPLES)
@click.option("--runs", type=click.IntRange(1), default=500, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True,
              help="Of the first scene; later ones count up.")  # fmt: skip
@click.option("--blind", is_flag=True,
              help="Switch a guard off in each; what is wrong has to be noticed.")  # fmt: skip
@click.option("--share", type=click.FloatRange(0.0, 1.0), default=0.2, show_default=True,
              help="Of the scenes that test/reference/independent solves, too.")  # fmt: skip
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count(),
              show_default="one for each core", help="Number of processes.")  # fmt: skip
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), default=ROOT / "benchmarks/results",
    show_default="benchmarks/results", help="Folder for missed_events.json.",
)  # fmt: skip
def main(runs: int, seed: int, blind: bool, share: float, workers: int, out: Path) -> None:
    """Does a motion pass over events within its ticks without saying so?

    Random scenes with stops, friction, flexible drives, limits, backlash, cords and contact, stiff
    and soft, in ticks of 0.1 to 50 ms, by every method, with and without error control; each is
    compared with ticks a hundred times shorter, and a share of them with a simulator that shares
    no line with the suite. A run may be off by ten times its tolerance, or by 1e-6 with steps of
    fixed length; otherwise its doubt or its stated error (within a factor of three) has to tell.
    Ends with an error if neither does. A motion that itself makes an allowed error too large is
    counted as magnified.
    """
    console, found = Console(stderr=True), list[Result]()
    look = partial(examine, blinded=blind, share=0.0 if blind else share)
    with Bar(console) as bar, ProcessPoolExecutor(min(workers, runs)) as pool:
        bar.stage("random scenes", runs)
        for one in pool.map(look, range(seed, seed + runs)):
            found.append(one)
            bar.advance()
    out.mkdir(parents=True, exist_ok=True)
    path = out / ("missed_events_blind.json" if blind else "missed_events.json")
    path.write_text(json.dumps([asdict(result) for result in found], indent=1))
    count = Counter(result.outcome for result in found)
    _show(found, count)
    if blind:
        judged = [result for result in found if result.outcome not in OTHERS]
        part = count[MISSED] / max(1, len(judged))
        click.echo(f"not noticed: {count[MISSED]} of {len(judged)} wrong runs, {part:.2%}")
    click.echo(f"report: {path}")
    sys.exit(count[MISSED] > 0)


def _show(found: list[Result], count: Counter[str]) -> None:
    table = Table("runs", *OUTCOMES)
    table.add_row(str(len(found)), *(str(count[name]) for name in OUTCOMES))
    Console().print(table)
    for result in found:
        if result.outcome in (MISSED, MAGNIFIED):
            click.echo(
                f"{result.outcome}, seed {result.seed}: off by {result.error:.2g}, allowed "
                f"{result.allowed:.2g}, growth {result.growth:.2g}; {result.way}; {result.label}"
                f"{result.blind and f'; without {result.blind}'}"
            )
    apart = [result.apart for result in found if not np.isnan(result.apart)]
    if apart:
        click.echo(
            f"two truths of {len(apart)} scenes: apart by {max(apart):.2g} at most, "
            f"{np.median(apart):.2g} in the middle"
        )
