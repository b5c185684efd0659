# SPDX-License-Identifier: Apache-2.0
"""``./arm sweep``: simulate many closed loops of a study, as a table and figures."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from arm_sim.cli.arguments import Count
from arm_sim.cli.command import command
from arm_sim.cli.output import number, progress, say, table

if TYPE_CHECKING:
    from rich.table import Table

    from arm_studies.sweeps import Progress, Sweep

_LONGEST_LISTING = 20  # number of runs up to which each is printed
_LINE_INTERVAL = 5.0  # [s] between lines of progress without a terminal


@command(
    "./arm sweep study.yaml",
    "./arm sweep study.yaml --out results --workers 4",
    "./arm sweep study.yaml --cluster tcp://10.0.0.2:8786",
)
def sweep(
    study: Path,
    *,
    out: Path | None = None,
    workers: Count | None = None,
    cluster: Annotated[str | None, "--cluster ADDRESS"] = None,
    no_figures: bool = False,
) -> None:
    """Simulate all runs of a STUDY: closed loops with varied parameters, and their metrics.

    Rows are saved as they are computed: repeating the command continues an interrupted sweep. The
    table does not depend on the number of workers or their order, bit for bit.

    Args:
        out: Folder of the table, the figures and the journal, from which an interrupted sweep
            continues.  [default: reports/sweeps/NAME]
        workers: Number of worker processes.  [default: one per core]
        cluster: Address of a Dask scheduler whose workers simulate the runs.
        no_figures: Do not draw figures.
    """
    from rich.progress import BarColumn, MofNCompleteColumn

    from arm_studies.sweeps import sweep as run
    from arm_studies.sweeps.figures import draw

    folder = out or Path("reports/sweeps") / study.stem
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn(), "{task.fields[left]}")
    first = {"description": "reading the study", "left": ""}
    try:
        with progress(sys.stderr, _in_lines(), *columns, **first) as bar:

            def show(now: Progress) -> None:
                left = _left(now.remaining)
                bar(description=now.activity, completed=now.done, total=now.total, left=left)

            done = run(study, folder, workers=workers, cluster=cluster, on_progress=show)
    except KeyboardInterrupt:
        click.echo(
            f"\ninterrupted; finished runs are saved in {folder}; the same command continues",
            err=True,
        )
        sys.exit(130)
    written = [done.table.save(folder)]
    if not no_figures:
        written += draw(done.study, done.table, folder)
    summary = _runs(done) if len(done.table) <= _LONGEST_LISTING else _groups(done)
    say(summary, *_losses(done), *_remarks(done), *written)


def _remarks(done: Sweep) -> Iterator[str]:
    """How many runs were simulated now, and how fast."""
    if done.dropped:
        yield "the last line of the journal was damaged; its run was repeated"
    plan = done.plan
    means = f"{plan.compiled} in compiled code" if plan.compiled else "controllers in Python"
    if done.simulated:
        rate = done.simulated * done.study.duration / max(done.seconds, 1e-9)
        yield (
            f"{done.simulated} runs simulated in {done.seconds:.3g} s ({rate:.3g} × real time), "
            f"{plan.runs - done.simulated} resumed; {means}; sets of equations: {plan.worlds}"
        )
    else:
        yield f"all {plan.runs} runs were done before"


def _losses(done: Sweep) -> Iterator[str]:
    """Numbers of runs that were not done, by status, and the first of each."""
    columns = (done.table[name].tolist() for name in ("run", "status", "note"))
    runs = [run for run in zip(*columns, strict=True) if run[1] != "done"]
    for kind in dict.fromkeys(status for _, status, _ in runs):
        failures = [run for run in runs if run[1] == kind]
        run, _, note = failures[0]
        yield f"{len(failures)} of {done.plan.runs} runs {kind}; run {run}: {note}"


def _runs(done: Sweep) -> Table:
    """All runs: what is varied, and the metrics."""
    names = ["run", *done.table.varied, *done.table.metrics, "status"]
    columns = [done.table[name].tolist() for name in names]
    rows = ([x if isinstance(x, str) else number(x, 4) for x in row]
            for row in zip(*columns, strict=True))  # fmt: skip
    text = [i for i, column in enumerate(columns) if isinstance(column[0], str)]
    return table(names, rows, text)


def _groups(done: Sweep) -> Table:
    """The distribution of each metric, by scene, controller and the like."""
    import numpy as np

    from arm_studies.sweeps.figures import groups

    rows, runs_of = [], groups(done.table)
    for name, runs in runs_of.items():
        for metric in done.table.metrics:
            values = done.table[metric][runs & done.table.done]
            cells = ["-"] * 4
            if len(values):
                cells = [number(x, 4) for x in np.percentile(values, (5, 50, 95, 100))]
            rows.append([name, metric, str(len(values)), *cells])
    headings = ["runs of", "metric", "done", "5 %", "median", "95 %", "largest"]
    if len(runs_of) > 1:
        return table(headings, rows, (0, 1))
    return table(headings[1:], [row[1:] for row in rows], (0,))


def _in_lines() -> Callable[[str, int, int, str], None]:
    """A function that prints a line of progress periodically, without a terminal."""
    printed, activity = 0.0, ""

    def show(description: str, completed: int, total: int, left: str) -> None:
        nonlocal printed, activity
        now = time.monotonic()
        if now - printed < _LINE_INTERVAL and description == activity:
            return
        printed, activity = now, description
        end = f", {left}" if left else ""
        click.echo(f"{description}: {completed} of {total} runs{end}", err=True)

    return show


def _left(seconds: float | None) -> str:
    if seconds is None:
        return ""
    if seconds < 90.0:
        return f"about {max(1, round(seconds))} s left"
    if seconds < 5400.0:
        return f"about {round(seconds / 60.0)} min left"
    return f"about {seconds / 3600.0:.1f} h left"
