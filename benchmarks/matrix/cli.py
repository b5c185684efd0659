# SPDX-License-Identifier: Apache-2.0
"""The command line of the matrix."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from benchmarks.matrix.measure import (
    ROOT,
    effect,
    features,
    measured,
    reference,
    solutions,
    solved,
)
from benchmarks.matrix.page import MATTERS, NAME, keep, verdict, write
from benchmarks.reporting.progress import Bar

EXAMPLES = """\b
Examples:
  ./arm python -m benchmarks.matrix                   every pair on both arms; half an hour
  ./arm python -m benchmarks.matrix --arm planar      one arm
  ./arm python -m benchmarks.matrix --docs            also renew the page in docs/
"""


@click.command(epilog=EXAMPLES)
@click.option("--arm", "arms", multiple=True, type=click.Choice(list(features.ARMS)))
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=ROOT / "benchmarks/results",
    show_default="benchmarks/results",
    help="Folder for features-together.md and features-together.json.",
)
@click.option("--jobs", default=2, show_default=True, help="Number of processes.")
@click.option("--resume", is_flag=True, help="Keep the results of an interrupted run.")
@click.option("--docs", is_flag=True, help="Also update docs/laboratory/features-together.md.")
def main(arms: tuple[str, ...], out: Path, jobs: int, resume: bool, docs: bool) -> None:
    """Compare every pair of features, and many at once, with independent solutions.

    Ends with an error if a set is further off than it may be, or a feature does not matter.
    """
    if docs and arms:
        raise click.UsageError("--docs takes both arms; leave --arm away")
    console, known = Console(stderr=True), reference()
    kept = out / f"{NAME}.json"
    results: dict[str, Any] = json.loads(kept.read_text()) if resume and kept.exists() else {}
    began = time.perf_counter() - results.get("elapsed_s", 0.0)
    with Bar(console) as bar:
        for arm in arms or features.ARMS:
            for name, found in compared(arm, known, results.setdefault(arm, {}), jobs, bar):
                results[arm][name] = found
                results["elapsed_s"] = time.perf_counter() - began
                keep(results, out)
    path = write(results, out, ROOT / "docs/laboratory" if docs else None)
    bad = complaints(results, known)
    for line in bad:
        console.print(line)
    click.echo(f"report: {path}")
    sys.exit(1 if bad else 0)


def compared(
    arm: str, known: Any, have: dict[str, Any], jobs: int, bar: Bar
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Measure every set that is known of an arm and is not among ``have``, as they are done."""
    todo = {solutions.label(chosen): chosen for chosen in solved(arm, known)}
    for name in list(have):
        if name in todo and have[name].get("scene") == known[arm][name]["scene"]:
            del todo[name]
        else:
            del have[name]
    bar.stage(arm, len(todo))
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(attempt, arm, todo[name], known): name for name in todo}
        for done in as_completed(running):
            bar.advance()
            yield running[done], done.result()


def attempt(arm: str, chosen: tuple[str, ...], known: Any) -> dict[str, Any]:
    """What was measured, or why it could not be."""
    try:
        return measured(arm, chosen, known)
    except Exception as error:  # one that fails must not stop the others
        return {"failed": f"{type(error).__name__}: {error}"}


def complaints(results: dict[str, Any], known: Any) -> list[str]:
    """What is further off than it may be, and features that change nothing."""
    lines = []
    for arm in (arm for arm in features.ARMS if arm in results):
        for name, found in results[arm].items():
            if not verdict(found):
                lines.append(f"{arm}: {name}: {found}")
        for pair in features.sets(2):
            name = solutions.label(pair)
            if name not in known[arm]:
                lines.append(f"{arm}: {name}: no solution; make_features_together.py")
                continue
            idle = [f for f, change in effect(arm, pair, known).items() if change < MATTERS]
            lines += [f"{arm}: {name}: {f} does not matter" for f in idle]
    return lines
