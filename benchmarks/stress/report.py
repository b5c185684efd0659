# SPDX-License-Identifier: Apache-2.0
"""The report: tables, a figure, and all runs as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from arm_sim.figures import WIDTH, figure
from benchmarks.reporting.markdown import number, table
from benchmarks.reporting.style import MARKS, METHODS
from benchmarks.stress.holding import Held, summary
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
HALF_DECADES = 10.0 ** np.arange(-4.0, 2.1, 0.5)
FEWEST = 4  # runs that make a point
ROUNDING = 1e-16  # nothing below it is drawn


def write(results: Sequence[Result], held: Sequence[Held], out: Path, docs: Path | None) -> Path:
    """Write stability.json, stability.md and the figure; the figure also into ``docs``."""
    out.mkdir(parents=True, exist_ok=True)
    kept = {"runs": [asdict(r) for r in results], "held": [asdict(one) for one in held]}
    (out / "stability.json").write_text(json.dumps(kept, indent=1) + "\n")
    for folder in [out] if docs is None else [out, docs]:
        draw(results, folder / "figures/stability.png")
    (out / "stability.md").write_text(page(results, held))
    return out / "stability.md"


def page(results: Sequence[Result], held: Sequence[Held]) -> str:
    """All tables, in Markdown."""
    parts = {
        "Outcomes": f"{outcomes(results)}\n\n{wrong(results)}",
        "Survival by length of the tick": survival(results),
        "Errors of the runs that survive, relative to 1 + |q|: median, worst":
            errors(results),
        "Errors under error control: median, worst": delivered(results),
        "Sets that hold together": summary(held) if held else "Not run.",
    }  # fmt: skip
    sections = (f"## {title}\n\n{part}\n" for title, part in parts.items())
    return "\n".join([f"# Stability\n\n{counts(results)}\n", *sections])


def runs(results: Sequence[Result]) -> list[Result]:
    """All runs whose true motion is known, of scenes that were not refused."""
    return [r for r in results if r.outcome not in (UNSTEADY, REFUSED, HUNG, CRASHED)]


def outcomes(results: Sequence[Result]) -> str:
    """What became of the runs of each kind and method."""
    rows = []
    for kind in dict.fromkeys(r.kind for r in results):
        mine = [r for r in results if r.kind == kind]
        for name in names_of(mine):
            rows.append(_row(f"{kind}, {name}", [r for r in mine if r.name == name]))
        rows.append(_row(f"**{kind}, all**", mine))
    return table(["", "runs", *OUTCOMES, "false alarms"], rows)


def _row(name: str, mine: Sequence[Result]) -> list[object]:
    number_of = [sum(r.outcome == outcome for r in mine) for outcome in OUTCOMES]
    return [name, len(mine), *number_of, sum(r.false_alarm for r in mine)]


def survival(results: Sequence[Result]) -> str:
    """How often each method survives at each step."""
    return _by_step(runs(results), _percent)


def errors(results: Sequence[Result]) -> str:
    """How wrong each method is at each step where it survives: median and worst."""
    survived = [r for r in runs(results) if r.outcome == SURVIVED]
    return _by_step(survived, lambda some: _spread(r.error for r in some))


def fixed(results: Sequence[Result]) -> list[Point]:
    """Runs with fixed steps of arms without dry friction."""
    return [(r.dt * r.rate, r) for r in runs(results)
            if r.kind == "arms" and r.tolerance is None and r.rate > 0
            and "dry friction" not in r.traits]  # fmt: skip


def delivered(results: Sequence[Result]) -> str:
    """Error over the tolerance asked for, and over the error that the recording states."""
    controlled, rows = [r for r in runs(results) if r.tolerance and r.error is not None], []
    for name in names_of(controlled):
        mine = [r for r in controlled if r.name == name]
        asked = [r.error / r.tolerance for r in mine if r.error and r.tolerance]
        stated = [r.error / r.stated for r in mine if r.error and r.stated]
        rows.append([name, len(mine), _spread(asked), _spread(stated)])
    return table(["method", "runs", "error / tolerance", "error / stated error"], rows)


def wrong(results: Sequence[Result]) -> str:
    """What must not be: each by name, with the seed that repeats it."""
    bad = [f"- {line(r)}" for r in results if r.outcome in FORBIDDEN]
    return "\n".join(bad) or "No run hung or crashed, and every error was told of."


def line(r: Result) -> str:
    """One run in words."""
    error = "" if r.error is None else f", off by {number(r.error, 2)}"
    within = "" if r.tolerance is None else f" to {r.tolerance:.1g}"
    return (
        f"**{r.outcome}**: {r.kind}, seed {r.seed}, {r.name}{within}, tick {r.dt:g} s, "
        f"{', '.join(r.traits)}{error}" + f"; {r.message}" * bool(r.message)
    )


def counts(results: Sequence[Result]) -> str:
    """How much was run, and how far the two truths are apart."""
    apart = [r.apart for r in results if r.apart is not None]
    scenes = {(r.kind, r.seed) for r in results}
    twice = {(r.kind, r.seed) for r in results if r.apart is not None}
    return (
        f"{len(scenes)} scenes (seeds from {min(r.seed for r in results)} on) in "
        f"{len(results)} runs; "
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


def draw(results: Sequence[Result], path: Path) -> None:
    """Draw survival and errors with fixed steps and without dry friction."""
    points = fixed(results)
    with figure(path, 1, 2, (WIDTH, 3.4)) as axes:
        shares, errors = axes
        for mark, (key, name) in zip(MARKS, METHODS.items(), strict=False):
            mine = [point for point in points if point[1].name == key]
            shares.plot(*_share(mine), marker=mark, label=name)
            errors.plot(*_error(mine), marker=mark)
        for axis in (shares, errors):
            axis.set(xscale="log", xlabel="step × fastest rate of the arm")
        shares.set(ylim=(-3, 103), ylabel="stable runs [%]")
        errors.set(yscale="log", ylim=(ROUNDING / 2, 10), ylabel="median error of q / (1 + |q|)")


def _share(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    groups = _grouped(points)
    return list(groups), [100 * _survival(some) for some in groups.values()]


def _error(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    groups = _grouped([(x, r) for x, r in points if r.outcome == SURVIVED])
    middle = [np.median([r.error for r in some if r.error is not None])
              for some in groups.values()]  # fmt: skip
    return list(groups), [max(float(error), ROUNDING) for error in middle]


def _grouped(points: Sequence[Point]) -> dict[float, list[Result]]:
    groups = {}
    for low, high in zip(HALF_DECADES[:-1], HALF_DECADES[1:], strict=True):
        some = [r for x, r in points if low <= x < high]
        if len(some) >= FEWEST:
            groups[float(np.sqrt(low * high))] = some
    return groups


def _survival(some: Sequence[Result]) -> float:
    return sum(r.outcome == SURVIVED for r in some) / len(some) if some else np.nan
