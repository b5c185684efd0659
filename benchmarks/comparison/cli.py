# SPDX-License-Identifier: Apache-2.0
"""The command line of the benchmark."""

import json
from pathlib import Path

import click
from rich.console import Console

from benchmarks.comparison import suite
from benchmarks.comparison.report import about, summary, write
from benchmarks.comparison.scoreboard import page

ROOT = Path(__file__).parents[2]

EXAMPLES = """\b
Examples:
  ./arm bench                          everything; about fifteen minutes
  ./arm bench --quick                  under two minutes, Panda only
  ./arm bench --only cost --only rollouts
  ./arm bench --out /tmp/report        somewhere else than benchmarks/results
  ./arm bench --scoreboard             also this suite beside its peers, task by task, in a page
"""


@click.command(epilog=EXAMPLES)
@click.option("--quick", is_flag=True, help="Panda only, fewer repeats, shorter horizons.")
@click.option("--only", multiple=True, type=click.Choice(suite.STUDIES),
              help="Run only this study; may be repeated.  [default: all]")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False),
              default=ROOT / "benchmarks/results", show_default="benchmarks/results",
              help="Folder for report.md, report.json and the figures.")  # fmt: skip
@click.option("--scoreboard", is_flag=True, help="Also write scoreboard.md, task by task.")
def main(quick: bool, only: tuple[str, ...], out: Path, scoreboard: bool) -> None:
    """Measure run time against error, here and in MuJoCo, Drake, Exudyn and others, in one run.

    Writes a Markdown report, the same as JSON, and figures. Simulators that are not installed
    are left out by name. Times are processor times; leave the machine alone meanwhile.
    """
    console = Console(stderr=True)
    for results in suite.run(quick, only or suite.STUDIES, console):
        out.mkdir(parents=True, exist_ok=True)  # a run that is cut short is not lost
        (out / "report.json").write_text(json.dumps(results, indent=1) + "\n")
    path = write(results, out)
    console.print(summary(results))
    console.print(f"report: {path}")
    if scoreboard:
        path = out / "scoreboard.md"
        path.write_text(page(results, about(results)))
        console.print(f"scoreboard: {path}")
