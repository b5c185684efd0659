# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.trajectory_optimization``: an iteration, next to Crocoddyl's."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np

from benchmarks.measurement.intervals import of_median
from benchmarks.measurement.timing import Job, Noise, interleaved
from benchmarks.reporting.markdown import table
from benchmarks.robots.models import panda
from benchmarks.trajectory_optimization.problem import (
    DRY,
    FRICTION,
    MOTORS,
    SMOOTHING,
    Problem,
)

OURS, RIGID = "`ILQR`, motors and friction in the model", "`ILQR`, the rigid arm alone"
ROUGH = "`ILQR`, motors and dry friction in the model"
SOLVERS = {"SolverDDP": "Crocoddyl, DDP", "SolverBoxDDP": "Crocoddyl, DDP with limits"}
THERE = Path(__file__).with_name("crocoddyl_side.py")


@click.command()
@click.option("--crocoddyl", "python", type=click.Path(exists=True, dir_okay=False),
              help="A Python with Crocoddyl, in an environment of its own (pip install "
              "crocoddyl==3.2.1 libpinocchio==4.0.0 pin==4.0.0: with 4.1.0 its arms have no "
              "weight); without it, only ILQR is measured.")  # fmt: skip
@click.option("--repeats", default=40, show_default=True, help="Number of rounds.")
@click.option("--out", default=Path("reports/trajectory_optimization.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(python: str | None, repeats: int, out: Path) -> None:
    """Time an iteration of iLQR on a Panda, 100 nodes of 10 ms, next to Crocoddyl's DDP."""
    full = Problem(panda(), {"actuator": MOTORS, "friction": FRICTION})
    rough = Problem(panda(), {"actuator": MOTORS, "friction": DRY}, SMOOTHING)
    rigid = Problem(panda(), {})
    ours, noise = {OURS: full, ROUGH: rough, RIGID: rigid}, Noise()
    jobs: dict[str, Job] = {name: problem.iteration for name, problem in ours.items()}
    for name, problem in ours.items():
        done = problem.solve()  # compiles
        click.echo(f"{name}: cost {done.costs[0]:.4f} -> {done.cost:.4f} in "
                   f"{len(done.costs) - 1} iterations")  # fmt: skip
    with _other_side(python, rigid) as others:
        measured = interleaved(jobs | others, repeats, noise, lambda: None)
    click.echo(table(("processor time of one core", "median [ms]", "quartiles"), [
        (name, f"{1e3 * c.median:.2f}", f"{1e3 * c.low:.2f} – {1e3 * c.high:.2f}")
        for name, c in measured.items()
    ]) + "\n")  # fmt: skip
    found = {}
    for name in ours:
        for other in others:
            ratio = np.array(measured[name].samples) / np.array(measured[other].samples)
            found[f"{name} ÷ {other}"] = [float(np.median(ratio)), *of_median(ratio.tolist())]
    click.echo(table(("ratio, within each round", "median", "95 % interval"), [
        (name, f"{m:.2f}", f"{low:.2f} – {high:.2f}") for name, (m, low, high) in found.items()
    ]) + "\n")  # fmt: skip
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({
        "seconds": {name: [c.low, c.median, c.high] for name, c in measured.items()},
        "ratios": found, "machine": noise.summary(),
    }, indent=1))  # fmt: skip


@contextmanager
def _other_side(python: str | None, problem: Problem) -> Iterator[dict[str, Job]]:
    """Crocoddyl's solvers as jobs, in another process that lives as long as the block."""
    if python is None:
        click.echo("Crocoddyl is left out: --crocoddyl names no Python that has it", err=True)
        yield {}
        return
    own = {k: v for k, v in os.environ.items() if k not in ("LD_LIBRARY_PATH", "PYTHONPATH")}
    own["OMP_NUM_THREADS"] = "1"  # as ours; threads that wait would count as work
    process = subprocess.Popen(
        [python, "-P", str(THERE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env=own,
    )  # fmt: skip
    try:
        _tell(process, json.dumps(problem.for_others()))
        for solver, name in SOLVERS.items():
            first = _asked(process, solver)
            click.echo(f"{name}, {first['version']}: cost {first['first']:.4f} -> "
                       f"{first['cost']:.4f} in {first['iterations']} iterations")  # fmt: skip
        yield {
            name: lambda solver=solver: float(_asked(process, solver)["seconds"])
            for solver, name in SOLVERS.items()
        }
    finally:
        process.kill()
        process.wait()


def _tell(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdin is not None
    process.stdin.write(line + "\n")
    process.stdin.flush()


def _asked(process: subprocess.Popen[str], solver: str) -> dict[str, Any]:
    assert process.stdout is not None
    _tell(process, solver)
    line = process.stdout.readline()
    if not line:
        raise click.ClickException("the other Python ended; above it says why")
    return dict(json.loads(line))
