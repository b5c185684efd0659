# SPDX-License-Identifier: Apache-2.0
"""The command line of the accuracy report."""

from __future__ import annotations

import platform
import runpy
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from arm_sim.integrators.methods import METHODS
from benchmarks.accuracy import sweep, wheels
from benchmarks.accuracy.page import at_1_ms, write
from benchmarks.accuracy.problems import ROOT, Problem, all_problems
from benchmarks.reporting.progress import Bar

EXAMPLES = """\b
Examples:
  ./arm python -m benchmarks.accuracy                   every problem; a minute or two
  ./arm python -m benchmarks.accuracy --only Panda      one problem
  ./arm python -m benchmarks.accuracy --docs            also renew its figure in docs/laboratory
"""

KINDS = ("fixed", "controlled", "scipy", "orders")


@click.command(epilog=EXAMPLES)
@click.option("--only", multiple=True, help="Run only this problem; may be repeated.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=ROOT / "benchmarks/results",
    show_default="benchmarks/results",
    help="Folder for accuracy.md, accuracy.json and figures/accuracy.png.",
)
@click.option("--docs", is_flag=True, help="Also renew the figure in docs/laboratory.")
def main(only: tuple[str, ...], out: Path, docs: bool) -> None:
    """Measure the error of every method, step and tolerance on motions that are known."""
    if docs and only:
        raise click.UsageError("--docs takes all problems; leave --only away")
    gate = runpy.run_path(str(ROOT / "test/tolerances.py"))["TRAJECTORY"]
    results = run(chosen(all_problems(gate), only), Console(stderr=True))
    path = write(results, out, ROOT / "docs/laboratory" if docs else None)
    click.echo(at_1_ms(results))
    click.echo(f"report: {path}")


def run(problems: list[Problem], console: Console) -> dict[str, Any]:
    """Run everything."""
    results: dict[str, list[Any]] = {name: [] for name in KINDS}
    with Bar(console) as bar:
        for problem in problems:
            bar.stage(problem.name, sweep.count(problem))
            for kind, rows in (
                ("fixed", sweep.fixed(problem)),
                ("controlled", sweep.controlled(problem)),
            ):
                for row in rows:
                    results[kind].append(row)
                    bar.advance()
            results["scipy"] += sweep.scipy_runs(problem)
            results["orders"] += sweep.orders(problem, results["fixed"])
        for name, rows in (("motors", wheels.motors()), ("friction", wheels.friction())):
            bar.stage(name, 1)
            results[name] = list(rows)
            bar.advance()
    return {"about": about(problems, bar.elapsed), **results}


def about(problems: list[Problem], elapsed: float) -> dict[str, Any]:
    """What was run, and on what."""
    return {
        "machine": platform.machine(),
        "elapsed_s": elapsed,
        "methods": {m.name: {"order": m.order, "source": m.source} for m in METHODS.values()},
        "problems": [
            {
                "name": p.name,
                "truth": p.truth,
                "duration_s": p.duration,
                "gate": p.gate,
                "gated": p.gated,
                "steps_s": p.steps,
            }
            for p in problems
        ],
    }


def chosen(problems: list[Problem], only: tuple[str, ...]) -> list[Problem]:
    """The problems named, or all."""
    names = [problem.name for problem in problems]
    for name in only:
        if name not in names:
            raise click.BadParameter(f"{name!r}; allowed: {', '.join(names)}", param_hint="--only")
    return [problem for problem in problems if not only or problem.name in only]
