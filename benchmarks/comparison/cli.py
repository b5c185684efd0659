# SPDX-License-Identifier: Apache-2.0
"""The command line of the benchmark."""

from __future__ import annotations

import json
from pathlib import Path

import click
from rich.console import Console

from benchmarks.comparison import figures, suite
from benchmarks.comparison.report import save, summary, write, write_scoreboard
from benchmarks.studies.bench import Record

ROOT = Path(__file__).parents[2]

EXAMPLES = """\b
Examples:
  ./arm bench                          everything; about fifteen minutes
  ./arm bench --quick                  under two minutes, Panda only
  ./arm bench --only cost --only rollouts
  ./arm bench --out /tmp/report        somewhere else than benchmarks/results
  ./arm bench --scoreboard             also this suite beside its peers, task by task, in a page
  ./arm bench --docs                   also renew the figures in docs/laboratory
  ./arm bench --again benchmarks/results/report.json --docs    the same without measuring
"""


@click.command(epilog=EXAMPLES)
@click.option("--quick", is_flag=True, help="Panda only, fewer repeats, shorter horizons.")
@click.option(
    "--only",
    multiple=True,
    type=click.Choice(suite.STUDIES),
    help="Run only this study; may be repeated.  [default: all]",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=ROOT / "benchmarks/results",
    show_default="benchmarks/results",
    help="Folder for report.md, report.json and the figures.",
)
@click.option("--scoreboard", is_flag=True, help="Also write scoreboard.md, task by task.")
@click.option("--docs", is_flag=True, help="Also renew the figures in docs/laboratory.")
@click.option(
    "--again",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="Measure nothing; write the reports from an earlier report.json.",
)
def main(
    quick: bool,
    only: tuple[str, ...],
    out: Path,
    scoreboard: bool,
    docs: bool,
    again: Path | None,
) -> None:
    """Measure run time against error, here and in MuJoCo, Drake, Exudyn and others, in one run.

    Writes a Markdown report, the same as JSON, and figures. Simulators that are not installed
    are left out by name. Times are processor times; leave the machine alone meanwhile.
    """
    if docs and (quick or only):
        raise click.UsageError("--docs wants every study in full: no --quick, no --only")
    console = Console(stderr=True)
    if again:
        results = _earlier(again, docs)
    else:
        for results in suite.run(quick, only or suite.STUDIES, console):
            save(results, out)  # a run that is cut short is not lost
    path = write(results, out)
    console.print(summary(results))
    console.print(f"report: {path}")
    if scoreboard:
        console.print(f"scoreboard: {write_scoreboard(results, out)}")
    if docs:
        figures.draw(results, ROOT / "docs/laboratory/figures")


def _earlier(path: Path, docs: bool) -> Record:
    try:
        results = json.loads(path.read_text())
        quick = results["about"]["quick"]
        lacking = [name for name in suite.STUDIES if name not in results]
        if docs and (lacking or quick):
            raise click.UsageError(f"{path} is of a quick run or lacks {', '.join(lacking)}")
        return suite.judged(results)
    except (ValueError, KeyError, TypeError) as error:
        raise click.UsageError(f"{path} is not a report of this benchmark: {error!r}") from None
