# SPDX-License-Identifier: Apache-2.0
"""The numbers of the report, as Markdown tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from benchmarks.reporting.markdown import number, table
from benchmarks.stress.judge import (
    CRASHED,
    FORBIDDEN,
    HUNG,
    OUTCOMES,
    REFUSED,
    SURVIVED,
    UNSTEADY,
    Result,
)

Point = tuple[float, Result]


def runs(found: Sequence[Result]) -> list[Result]:
    """All runs whose true motion is known, of scenes that were not refused."""
    return [r for r in found if r.outcome not in (UNSTEADY, REFUSED, HUNG, CRASHED)]


def outcomes(found: Sequence[Result]) -> str:
    """What became of the runs of each kind and method."""
    rows = []
    for kind in dict.fromkeys(r.kind for r in found):
        mine = [r for r in found if r.kind == kind]
        for name in names_of(mine):
            rows.append(_row(f"{kind}, {name}", [r for r in mine if r.name == name]))
        rows.append(_row(f"**{kind}, all**", mine))
    return table(["", "runs", *OUTCOMES, "false alarms"], rows)


def _row(name: str, mine: Sequence[Result]) -> list[object]:
    number_of = [sum(r.outcome == outcome for r in mine) for outcome in OUTCOMES]
    return [name, len(mine), *number_of, sum(r.false_alarm for r in mine)]


def survival(found: Sequence[Result]) -> str:
    """How often each method survives at each step."""
    return _by_step(runs(found), _percent)


def errors(found: Sequence[Result]) -> str:
    """How wrong each method is at each step where it survives: median and worst."""
    survived = [r for r in runs(found) if r.outcome == SURVIVED]
    return _by_step(survived, lambda some: _spread(r.error for r in some))


def fixed(found: Sequence[Result]) -> list[Point]:
    """Runs with fixed steps of arms without dry friction."""
    return [(r.dt * r.rate, r) for r in runs(found)
            if r.kind == "arms" and r.tolerance is None and r.rate > 0
            and "dry friction" not in r.traits]  # fmt: skip


def delivered(found: Sequence[Result]) -> str:
    """Error over the tolerance asked for, and over the error that the recording states."""
    controlled, rows = [r for r in runs(found) if r.tolerance and r.error is not None], []
    for name in names_of(controlled):
        mine = [r for r in controlled if r.name == name]
        asked = [r.error / r.tolerance for r in mine if r.error and r.tolerance]
        stated = [r.error / r.stated for r in mine if r.error and r.stated]
        rows.append([name, len(mine), _spread(asked), _spread(stated)])
    return table(["method", "runs", "error / tolerance", "error / stated error"], rows)


def wrong(found: Sequence[Result]) -> str:
    """What must not be: each by name, with the seed that repeats it."""
    bad = [f"- {line(r)}" for r in found if r.outcome in FORBIDDEN]
    return "\n".join(bad) or "No run hung or crashed, and every error was told of."


def line(r: Result) -> str:
    """One run in words."""
    error = "" if r.error is None else f", off by {number(r.error, 2)}"
    within = "" if r.tolerance is None else f" to {r.tolerance:.1g}"
    return (
        f"**{r.outcome}**: {r.kind}, seed {r.seed}, {r.name}{within}, tick {r.dt:g} s, "
        f"{', '.join(r.traits)}{error}" + f"; {r.message}" * bool(r.message)
    )


def counts(found: Sequence[Result]) -> str:
    """How much was run, and how far the two truths are apart."""
    apart = [r.apart for r in found if r.apart is not None]
    scenes, twice = ({(r.kind, r.seed) for r in some}
                     for some in (found, [r for r in found if r.apart is not None]))  # fmt: skip
    return (
        f"{len(scenes)} scenes (seeds from {min(r.seed for r in found)} on) in {len(found)} runs; "
        f"{len(twice)} also by the independent simulator, which differs by "
        f"{number(max(apart, default=None), 1)} at most."
    )


def names_of(results: Sequence[Result]) -> list[str]:
    """Methods, those with error control last."""
    return sorted({r.name for r in results}, key=lambda name: (" " in name, name))


def _by_step(results: Sequence[Result], cell: Callable[[Sequence[Result]], str]) -> str:
    steps = sorted({r.dt for r in results}, reverse=True)
    rows = [
        [name, *(cell([r for r in results if (r.name, r.dt) == (name, dt)]) for dt in steps)]
        for name in names_of(results)
    ]
    return table(["method", *(f"{dt:g} s" for dt in steps)], rows)


def _percent(some: Sequence[Result]) -> str:
    good = sum(r.outcome == SURVIVED for r in some)
    return f"{good / len(some):.0%}" if some else "—"


def _spread(values: Iterable[float | None]) -> str:
    """Median and worst."""
    known = [value for value in values if value is not None]
    return f"{number(float(np.median(known)), 2)}, {number(max(known), 2)}" if known else "—"
