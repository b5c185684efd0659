# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.stress``: the command line."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click
from rich.console import Console
from rich.progress import Progress

from benchmarks.stress import campaign
from benchmarks.stress.trial import FORBIDDEN

EXAMPLES = """\b
Examples:
  ./arm stress                        thirty trees; several minutes the first time, for compiling
  ./arm stress --trees 200 --seed 1000
  ./arm stress --trees 1 --seed 17    one tree again
  ./arm stress --backend vm           without compiling
"""


@click.command(epilog=EXAMPLES)
@click.option("--trees", default=30, show_default=True, type=click.IntRange(1), help="How many.")
@click.option("--seed", default=0, show_default=True, help="Of the first tree.")
@click.option(
    "--backend", default="auto", show_default=True, type=click.Choice(["auto", "native", "vm"])
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path(__file__).parents[1] / "results",
    show_default="benchmarks/results",
    help="Folder for stress.md and stress.json.",
)
def main(trees: int, seed: int, backend: str, out: Path) -> None:
    """Random trees of 1 to 30 joints at their worst, with every method and step size.

    Masses from 1 g to 1 t, links from 1 mm to 10 m, speeds to 100 rad/s, needles, torques of a
    hundred times gravity, steps from 10 µs to 10 ms. Exits with 1 if anything went wrong without
    saying so.
    """
    console = Console(stderr=True)
    with Progress(console=console) as bar:
        task = bar.add_task("trees", total=trees)
        found = list(campaign.run(seed, trees, backend, advance=lambda: bar.advance(task)))
    out.mkdir(parents=True, exist_ok=True)
    (out / "stress.json").write_text(json.dumps(campaign.plain(found), indent=1) + "\n")
    (out / "stress.md").write_text(campaign.report(found))
    bad = [r for r in found if r.outcome in FORBIDDEN]
    console.print(f"{len(found)} runs, {len(bad)} wrong without saying so; {out / 'stress.md'}")
    sys.exit(1 if bad else 0)


main(prog_name="python -m benchmarks.stress")
