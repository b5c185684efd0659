# SPDX-License-Identifier: Apache-2.0
"""The report: tables, a figure, and all numbers as JSON."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from arm_sim.figures import COLORS, WIDTH, figure
from arm_sim.integrators.methods import METHODS
from benchmarks.accuracy import wheels
from benchmarks.accuracy.problems import TICKS
from benchmarks.accuracy.sweep import CONTROLLED, TOLERANCES
from benchmarks.reporting.markdown import number, table
from benchmarks.reporting.style import MARKS
from benchmarks.reporting.style import METHODS as TITLES

Results = dict[str, Any]
PANELS = "double pendulum", "free top", "four-bar", "Panda", "stiff elbow"
LOOKS = dict(zip(TITLES, zip(COLORS, MARKS, strict=False), strict=True))
LONG = "long pendulum"  # is an exception, on the page


def write(results: Results, out: Path) -> Path:
    """Write accuracy.json, accuracy.md and the figure."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "accuracy.json").write_text(json.dumps(results, indent=1) + "\n")
    draw(results, out / "figures/accuracy.png")
    (out / "accuracy.md").write_text(page(results))
    return out / "accuracy.md"


def page(results: Results) -> str:
    parts = {
        "Errors at 1 ms": at_1_ms(results),
        "Orders": _orders(results),
        "Errors of DOP853 by tolerance": _by_tolerance(results),
        "Motors": wheels.shown(results["motors"]),
        "Dry friction": wheels.shown([r for r in results["friction"] if r["law"] == "dry"]),
        "LuGre friction": wheels.shown([r for r in results["friction"] if r["law"] == "LuGre"]),
    }
    tables = (f"## {title}\n\n{part}\n" for title, part in parts.items())
    return "\n".join(["# Accuracy\n", *tables])


def at_1_ms(results: Results) -> str:
    rows = [r | {"shown": _error(r["error"])} for r in results["fixed"] if r["step_s"] == 1e-3]
    return _by_method(results, rows)


def _orders(results: Results) -> str:
    rows = [r | {"shown": f"{r['order']:.1f}"} for r in results["orders"]]
    return _by_method(results, rows, ["**stated**", *(f"**{m.order}**" for m in METHODS.values())])


def _by_method(results: Results, rows: Sequence[Results], *first: Sequence[str]) -> str:
    """Cells of problems as rows and methods as columns."""
    cells = {(r["problem"], r["method"]): r["shown"] for r in rows}
    lines = [[p["name"], *(cells.get((p["name"], method), "—") for method in METHODS)]
             for p in results["problems"]]  # fmt: skip
    return table(["problem", *METHODS], [*first, *lines])


def _by_tolerance(results: Results) -> str:
    cells = {(r["problem"], r["tolerance"]): _error(r["error"]) for r in results["controlled"]
             if (r["method"], r["tick_s"]) == ("dop853", TICKS[1])}  # fmt: skip
    names = [p["name"] for p in results["problems"]]
    rows = [[name, *(cells[name, tolerance] for tolerance in TOLERANCES)] for name in names]
    return table(["problem", *(number(t, 1) for t in TOLERANCES)], rows)


def _error(value: float | None) -> str:
    return "lost" if value is None else number(value, 2)


def draw(results: Results, path: Path) -> None:
    names = [p["name"] for p in results["problems"]]
    panels = [name for name in PANELS if name in names] or names[:1]
    rows = -(-(len(panels) + 1) // 3)
    columns, size = min(3, len(panels) + 1), (WIDTH, 2.5 * rows + 0.7)
    with figure(path, rows, columns, size, squeeze=False) as axes:
        for axis, name in zip(axes.flat, panels, strict=False):
            _draw_steps(axis, results, name)
        _draw_controlled(axes.flat[len(panels)], results)
        for axis in (*axes[:, 0], axes.flat[len(panels)]):
            axis.set_ylabel("largest error [rad] or [m]")


def _draw_steps(axis: Any, results: Results, name: str) -> None:
    problem = next(p for p in results["problems"] if p["name"] == name)
    for method, (color, mark) in LOOKS.items():
        line = [r for r in results["fixed"]
                if (r["problem"], r["method"]) == (name, method) and r["error"]]  # fmt: skip
        axis.plot([r["step_s"] for r in line], [r["error"] for r in line], marker=mark,
                  color=color, ms=3.0, lw=1.0, label=TITLES[method],
                  ls="--" if method == "implicit" else "-")  # it coincides with RK4  # fmt: skip
    axis.plot(1e-3, problem["gate"], "_", color="0.3", ms=16.0, mew=1.8, zorder=3,
              label="limit of the tests at 1 ms")  # fmt: skip
    axis.set(xscale="log", yscale="log", ylim=(1e-16, 10), xlabel="step [s]",
             title=f"{name}, {problem['duration_s']:g} s")  # fmt: skip


def _draw_controlled(axis: Any, results: Results) -> None:
    """Median and range over the problems, error control with ticks so long that it decides."""
    rows = [r for r in results["controlled"] if r["tick_s"] == TICKS[1] and r["error"]]
    for method in CONTROLLED[:2]:
        errors = [[r["error"] for r in rows if (r["method"], r["tolerance"]) == (method, tolerance)
                   and r["problem"] != LONG] for tolerance in TOLERANCES]  # fmt: skip
        color, mark = LOOKS[method]
        axis.fill_between(TOLERANCES, [min(e) for e in errors], [max(e) for e in errors],
                          color=color, alpha=0.2, lw=0)  # fmt: skip
        axis.plot(TOLERANCES, [np.median(e) for e in errors], marker=mark, color=color, ms=3.0,
                  lw=1.0)  # fmt: skip
    ends = np.array([TOLERANCES[-1], TOLERANCES[0]])
    axis.plot(ends, ends, color="0.3", lw=1.2, ls=":", label="error = tolerance")
    axis.fill_between([], [], color="0.4", alpha=0.2, lw=0, label="range over all problems")
    axis.set(xscale="log", yscale="log", xlabel="tolerance", title="error control (medians)")
