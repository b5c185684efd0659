# SPDX-License-Identifier: Apache-2.0
"""The command line of the benchmark."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from benchmarks import suite
from benchmarks.report import summary, write

EXAMPLES = """\b
Examples:
  ./arm bench                          everything; about fifteen minutes
  ./arm bench --quick                  under two minutes, Panda only
  ./arm bench --only cost --only rollouts
  ./arm bench --out /tmp/report        somewhere else than benchmarks/results
"""


@click.command(epilog=EXAMPLES)
@click.option("--quick", is_flag=True, help="Panda only, fewer repeats, shorter horizons.")
@click.option(
    "--only",
    multiple=True,
    type=click.Choice(suite.STUDIES),
    help="Run this study; may be given more than once. Without it all run.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path(__file__).parent / "results",
    show_default="benchmarks/results",
    help="Folder for report.md, report.json and the figures.",
)
def main(quick: bool, only: tuple[str, ...], out: Path) -> None:
    """Measure run time against error, here and in MuJoCo, Drake, PyBullet and SciPy, in one run.

    Writes a Markdown report, the same as JSON, and figures. Simulators that are not installed
    are left out by name. Times are processor times; leave the machine alone meanwhile.
    """
    console = Console(stderr=True)
    for results in suite.run(quick, only or suite.STUDIES, console):
        path = write(results, out)  # after every study: a long run that is cut short is not lost
    console.print(summary(results))
    console.print(f"report: {path}")
