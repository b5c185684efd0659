# SPDX-License-Identifier: Apache-2.0
"""Many trees, every method, every step size."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from arm_dynamics import ArmError
from arm_sim.integrators import METHODS
from benchmarks.markdown import number, table
from benchmarks.stress.trees import MOST_JOINTS, Tree, draw
from benchmarks.stress.trial import FORBIDDEN, OUTCOMES, REFUSED, Result, Subject

STEPS = (1e-5, 1e-4, 1e-3, 1e-2)  # [s]
TOLERANCES = (1e-6, 1e-9)


def methods() -> list[tuple[str, float | None]]:
    """Every integrator with fixed steps, and with error control where it has it."""
    fixed: list[tuple[str, float | None]] = [(name, None) for name in METHODS]
    adaptive = [name for name, method in METHODS.items() if method.adaptive]
    return fixed + [(name, tolerance) for name in adaptive for tolerance in TOLERANCES]


def run(
    seed: int, trees: int, backend: str = "auto", most_joints: int = MOST_JOINTS,
    advance: Callable[[], Any] = lambda: None,
) -> Iterator[Result]:  # fmt: skip
    """Try everything on every tree.

    Args:
        seed: of the first tree; the next have the next seeds.
        trees: how many.
        backend: of the simulator.
        most_joints: of a tree.
        advance: called after each tree.

    Yields:
        What became of each run.
    """
    for k in range(trees):
        yield from _tree(draw(seed + k, most_joints), backend)
        advance()


def _tree(tree: Tree, backend: str) -> Iterator[Result]:
    try:
        subject = Subject(tree, backend)
    except ArmError as error:
        yield Result(tree.seed, "any", 0.0, REFUSED, message=str(error))
        return
    for dt in STEPS:
        truth = subject.truth(dt)
        for method, tolerance in methods():
            yield subject.attempt(method, dt, tolerance, truth)


def report(results: list[Result]) -> str:
    """Markdown: how often each method survives, how wrong it is where it does, and what failed."""
    runs = [r for r in results if r.dt > 0]
    groups = dict.fromkeys((r.method, r.dt) for r in runs)
    rows = [_row(key, [r for r in runs if (r.method, r.dt) == key]) for key in groups]
    head = ("method", "step [s]", *OUTCOMES, "median error", "95 % error", "median balance")
    bad = [r for r in results if r.outcome in FORBIDDEN]
    trees = {r.seed for r in results}
    refused = [r for r in results if r.dt == 0]
    parts = [
        "# Stability under stress",
        f"{len(trees)} random trees (seeds {min(trees)} to {max(trees)}), {len(runs)} runs of 200 "
        f"ticks; {len(refused)} trees refused at once. Errors are relative to 1 + |q|, against an "
        "error-controlled run; the balance is energy from nowhere, relative to the energies at "
        "work. Both are of sound runs.",
        table(head, rows),
    ]
    parts += [f"- seed {r.seed}: refused: {r.message.splitlines()[0]}" for r in refused]
    parts += [f"- **{r.outcome}**: seed {r.seed}, {r.method}, step {r.dt:g} s" for r in bad]
    return "\n\n".join(parts) + "\n"


def plain(results: list[Result]) -> list[dict[str, Any]]:
    """The results for JSON."""
    return [asdict(r) for r in results]


def _row(key: tuple[str, float], runs: list[Result]) -> list[str]:
    counts = [f"{sum(r.outcome == name for r in runs) / len(runs):.0%}" for name in OUTCOMES]
    sound = [r for r in runs if r.outcome == OUTCOMES[0]]
    errors = [r.error for r in sound if r.error is not None]
    balances = [r.balance for r in sound if r.balance is not None]
    return [
        key[0], f"{key[1]:g}", *counts, _percentile(errors, 50), _percentile(errors, 95),
        _percentile(balances, 50),
    ]  # fmt: skip


def _percentile(values: list[float], part: float) -> str:
    return number(float(np.percentile(values, part)), 2) if values else "—"
