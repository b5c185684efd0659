# SPDX-License-Identifier: Apache-2.0
"""The command line of the accuracy report."""

import runpy
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from benchmarks.accuracy import sweep, wheels
from benchmarks.accuracy.page import at_1_ms, write
from benchmarks.accuracy.problems import ROOT, Problem, all_problems
from benchmarks.reporting.progress import Bar

EXAMPLES = """\b
Examples:
  ./arm python -m benchmarks.accuracy                   every problem; a minute or two
  ./arm python -m benchmarks.accuracy --only Panda      one problem
"""

GATE = runpy.run_path(str(ROOT / "test/tolerances.py"))["TRAJECTORY"]
PROBLEMS = {problem.name: problem for problem in all_problems(GATE)}


@click.command(epilog=EXAMPLES)
@click.option("--only", multiple=True, type=click.Choice([*PROBLEMS]),
              help="Run only this problem; may be repeated.")  # fmt: skip
@click.option("--out", type=click.Path(path_type=Path, file_okay=False),
              default=ROOT / "benchmarks/results", show_default="benchmarks/results",
              help="Folder for accuracy.md, accuracy.json and its figure.")  # fmt: skip
def main(only: tuple[str, ...], out: Path) -> None:
    """Measure the error of every method, step and tolerance on motions that are known."""
    results = run([PROBLEMS[name] for name in only or PROBLEMS], Console(stderr=True))
    path = write(results, out)
    click.echo(at_1_ms(results))
    click.echo(f"report: {path}")


def run(problems: list[Problem], console: Console) -> dict[str, Any]:
    results: dict[str, list[Any]] = {
        "problems": [
            {"name": p.name, "duration_s": p.duration, "gate": p.gate} for p in problems
        ],
    }  # fmt: skip
    with Bar(console) as bar:
        for name, rows in (
            *(("fixed", sweep.fixed(problem)) for problem in problems),
            *(("controlled", sweep.controlled(problem)) for problem in problems),
            ("motors", wheels.motors()), ("friction", wheels.friction()),
        ):  # fmt: skip
            bar.stage(name, None)
            for row in rows:
                results.setdefault(name, []).append(row)
                bar.done()
    orders = (sweep.orders(problem, results["fixed"]) for problem in problems)
    return results | {"orders": [row for rows in orders for row in rows]}
