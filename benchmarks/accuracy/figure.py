# SPDX-License-Identifier: Apache-2.0
"""The figure: error over step on five problems, and delivered over asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from arm_sim.figures import COLORS, WIDTH, figure
from benchmarks.accuracy.problems import TICKS
from benchmarks.accuracy.sweep import CONTROLLED, TOLERANCES
from benchmarks.reporting.style import MARKS, METHODS

PANELS = "double pendulum", "free top", "four-bar", "Panda", "stiff elbow"
LOOKS = dict(zip(METHODS, zip(COLORS, MARKS, strict=False), strict=True))
LONG = "long pendulum"  # is an exception, on the page


def draw(results: dict[str, Any], path: Path) -> None:
    """Draw the results into a PNG file."""
    names = [p["name"] for p in results["about"]["problems"]]
    panels = [name for name in PANELS if name in names] or names[:1]
    rows = -(-(len(panels) + 1) // 3)
    columns, size = min(3, len(panels) + 1), (WIDTH, 2.5 * rows + 0.7)
    with figure(path, rows, columns, size, squeeze=False) as axes:
        for axis, name in zip(axes.flat, panels, strict=False):
            _steps(axis, results, name)
        _asked(axes.flat[len(panels)], results)
        for axis in (*axes[:, 0], axes.flat[len(panels)]):
            axis.set_ylabel("largest error [rad] or [m]")


def _steps(axis: Any, results: dict[str, Any], name: str) -> None:
    problem = next(p for p in results["about"]["problems"] if p["name"] == name)
    for method, (color, mark) in LOOKS.items():
        line = [r for r in results["fixed"] if (r["problem"], r["method"]) == (name, method)]
        line = [r for r in line if r["error"]]
        axis.plot([r["step_s"] for r in line], [r["error"] for r in line], marker=mark,
                  color=color, ms=3.0, lw=1.0, label=METHODS[method])  # fmt: skip
    axis.axhline(problem["gate"], color="0.4", lw=0.8, ls=":")
    axis.set(xscale="log", yscale="log", ylim=(1e-16, 10), xlabel="step [s]",
             title=f"{name}, {problem['duration_s']:g} s")  # fmt: skip


def _asked(axis: Any, results: dict[str, Any]) -> None:
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
    axis.plot(ends, ends, color="0.4", lw=0.8, ls=":")
    axis.set(xscale="log", yscale="log", xlabel="tolerance", title="error control")
