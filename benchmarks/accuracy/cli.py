# SPDX-License-Identifier: Apache-2.0
"""The command line of the accuracy report."""

from __future__ import annotations

import platform
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from arm_sim.integrators.methods import METHODS
from benchmarks.accuracy import friction, motors, sweep
from benchmarks.accuracy.checks import checks
from benchmarks.accuracy.page import write
from benchmarks.accuracy.problems import ROOT, Problem, all_problems
from benchmarks.reporting.markdown import number
from benchmarks.reporting.progress import Bar

EXAMPLES = """\b
Examples:
  ./arm python -m benchmarks.accuracy                   every problem; a minute or two
  ./arm python -m benchmarks.accuracy --only Panda      one problem and the checks
  ./arm python -m benchmarks.accuracy --docs            also renew its figure in docs/laboratory
"""

KINDS = ("fixed", "controlled", "scipy", "orders", "gates")


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
    """Measure the error of every method, step and tolerance on motions that are known.

    Ends with an error if a figure misses the gate that the tests hold it to.
    """
    if docs and only:
        raise click.UsageError("--docs takes all problems; leave --only away")
    gates = tolerances()
    problems = chosen(all_problems(gates.TRAJECTORY), only)
    results = run(problems, gates, Console(stderr=True))
    path = write(results, out, ROOT / "docs/laboratory" if docs else None)
    Console().print(summary(results))
    click.echo(f"report: {path}")
    sys.exit(0 if all(gate["kept"] for gate in results["gates"]) else 1)


def run(problems: list[Problem], gates: Any, console: Console) -> dict[str, Any]:
    """Run everything.

    Args:
        problems: To run.
        gates: The tests' module of tolerances.
        console: For the progress bar.

    Returns:
        The results, ready for JSON.
    """
    found: dict[str, list[Any]] = {name: [] for name in KINDS}
    with Bar(console) as bar:
        for problem in problems:
            bar.stage(problem.name, sweep.count(problem))
            for kind, rows in (
                ("fixed", sweep.fixed(problem)),
                ("controlled", sweep.controlled(problem)),
            ):
                for row in rows:
                    found[kind].append(row)
                    bar.advance()
            found["scipy"] += sweep.scipy_runs(problem)
            found["orders"] += sweep.orders(problem, found["fixed"])
            found["gates"] += sweep.gates(problem, found)
        bar.stage("motors", 1)
        found["motors"] = list(motors.rows())
        found["gates"] += motors.gate(found["motors"], gates.MOTOR)
        bar.advance()
        bar.stage("friction", 1)
        found["friction"] = list(friction.rows())
        found["gates"] += friction.gate(found["friction"], gates.TRAJECTORY, gates.LUGRE)
        bar.advance()
        groups = checks(gates)
        bar.stage("checks", len(groups))
        for group in groups.values():
            found["gates"] += group()
            bar.advance()
    return {"about": about(problems, bar.elapsed), **found}


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


def tolerances() -> Any:
    """The tests' tolerances, so that a gate is written down once."""
    spec = spec_from_file_location("tolerances", ROOT / "test/tolerances.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def summary(results: dict[str, Any]) -> Table:
    """Gates and what was measured, for the terminal."""
    table = Table("gate", "measured", "allowed", "")
    for gate in results["gates"]:
        verdict = "[green]kept" if gate["kept"] else "[red]missed"
        measured = number(gate["measured"], 2)
        table.add_row(escape(gate["what"]), measured, number(gate["allowed"], 1), verdict)
    return table
