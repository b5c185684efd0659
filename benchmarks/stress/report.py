# SPDX-License-Identifier: Apache-2.0
"""The report: tables, a figure, and all runs as JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

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
Groups = dict[float, list[Result]]
STEP = "step × fastest rate of the arm"
HALF_DECADES = 10.0 ** np.arange(-4.0, 2.1, 0.5)
FEWEST = 4  # runs that make a point
ROUNDING = 1e-16  # nothing below it is drawn


def write(results: Sequence[Result], held: Sequence[Held], out: Path) -> Path:
    """Write stability.json, stability.md and the figure."""
    out.mkdir(parents=True, exist_ok=True)
    kept = {"runs": [asdict(r) for r in results], "held": [asdict(one) for one in held]}
    (out / "stability.json").write_text(json.dumps(kept, indent=1) + "\n")
    draw(results, out / "figures/stability.png")
    (out / "stability.md").write_text(page(results, held))
    return out / "stability.md"


def page(results: Sequence[Result], held: Sequence[Held]) -> str:
    parts = {
        "Outcomes": f"{outcomes(results)}\n\n{wrong(results)}",
        "Survival by length of the tick, with errors relative to 1 + |q|: median, worst":
            _by_step(runs(results)),
        "Sets that hold together": summary(held) if held else "Not run.",
    }  # fmt: skip
    sections = (f"## {title}\n\n{part}\n" for title, part in parts.items())
    return "\n".join([f"# Stability\n\n{counts(results)}\n", *sections])


def runs(results: Sequence[Result]) -> list[Result]:
    """All runs whose true motion is known, of scenes that were not refused."""
    return [r for r in results if r.outcome not in (UNSTEADY, REFUSED, HUNG, CRASHED)]


def outcomes(results: Sequence[Result]) -> str:
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


def fixed(results: Sequence[Result]) -> list[Point]:
    """Runs with fixed steps of arms without dry friction."""
    return [(r.dt * r.rate, r) for r in runs(results)
            if r.kind == "arms" and r.tolerance is None and r.rate > 0
            and "dry friction" not in r.traits]  # fmt: skip


def wrong(results: Sequence[Result]) -> str:
    """What must not be: each by name, with the seed that repeats it."""
    bad = [f"- {line(r)}" for r in results if r.outcome in FORBIDDEN]
    return "\n".join(bad) or "No run hung or crashed, and every error was told of."


def line(r: Result) -> str:
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


def _by_step(results: Sequence[Result]) -> str:
    steps = sorted({r.dt for r in results}, reverse=True)
    rows = [
        [name, *(_cell([r for r in results if (r.name, r.dt) == (name, dt)]) for dt in steps)]
        for name in names_of(results)
    ]
    return table(["method", *(f"{dt:g} s" for dt in steps)], rows)


def _cell(some: Sequence[Result]) -> str:
    errors = [r.error for r in some if r.outcome == SURVIVED and r.error is not None]
    if not errors:
        return "—"
    worst = f"{number(float(np.median(errors)), 2)}, {number(max(errors), 2)}"
    return f"{_survival(some):.0%} ({worst})"


def draw(results: Sequence[Result], path: Path) -> None:
    """Draw survival and errors with fixed steps and without dry friction."""
    points = fixed(results)
    names = {key: name for key, name in METHODS.items() if any(r.name == key for _, r in points)}
    groups = {key: _grouped([point for point in points if point[1].name == key]) for key in names}
    with figure(path, 1, 2, (WIDTH, 3.4), width_ratios=(1.0, 1.1)) as (shares, errors):
        _shares(shares, [*groups.values()], [*names.values()])
        for mark, (key, name) in zip(MARKS, names.items(), strict=False):
            errors.plot(*_errors(groups[key]), marker=mark, label=name)
        errors.set(
            xscale="log", yscale="log", ylim=(ROUNDING / 2, 10), xlabel=STEP,
            title="median error of right runs", ylabel="position error / (1 + |position|)",
        )  # fmt: skip


def _shares(axis: Any, groups: Sequence[Groups], names: Sequence[str]) -> None:
    """A table of the percentages of right runs: methods as rows, steps as columns."""
    steps = sorted({step for some in groups for step in some})
    if not steps:
        return
    table = np.array([[100 * _survival(some.get(step, ())) for step in steps] for some in groups])
    ends = np.log10([steps[0], steps[-1]]) + [-0.25, 0.25]
    rows = np.arange(len(names))
    axis.imshow(table, "Blues", aspect="auto", vmin=0, vmax=160,
                extent=(*ends, len(names) - 0.5, -0.5))  # fmt: skip
    for (row, column), share in np.ndenumerate(table):
        text = "–" if np.isnan(share) else f"{share:.0f}"
        axis.text(np.log10(steps[column]), row, text, ha="center", va="center", fontsize=8.5)
    decades = np.arange(np.ceil(ends[0]), ends[1])
    axis.set_xticks(decades, [f"$10^{{{decade:.0f}}}$" for decade in decades])
    axis.set_yticks(rows, names)
    axis.grid(visible=False)
    axis.set(xlabel=STEP, title="right runs [%]")


def _errors(groups: Groups) -> tuple[list[float], list[float]]:
    errors = {step: [r.error for r in some if r.outcome == SURVIVED and r.error is not None]
              for step, some in groups.items()}  # fmt: skip
    errors = {step: some for step, some in errors.items() if len(some) >= FEWEST}
    return list(errors), [max(float(np.median(some)), ROUNDING) for some in errors.values()]


def _grouped(points: Sequence[Point]) -> Groups:
    """Runs by the geometric mean of their half decade of steps, of those with enough runs."""
    groups = {}
    for low, high in pairwise(HALF_DECADES):
        some = [r for x, r in points if low <= x < high]
        if len(some) >= FEWEST:
            groups[float(np.sqrt(low * high))] = some
    return groups


def _survival(some: Sequence[Result]) -> float:
    return sum(r.outcome == SURVIVED for r in some) / len(some) if some else np.nan
