# SPDX-License-Identifier: Apache-2.0
"""The figure: error over step on six problems, and delivered over asked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.accuracy.problems import TICKS
from benchmarks.accuracy.sweep import CONTROLLED, TOLERANCES
from benchmarks.reporting.style import MARKS, STYLE

PANELS = (
    "pendulum", "double pendulum", "spherical pendulum", "free top", "four-bar", "Panda",
    "stiff elbow",
)  # fmt: skip
COLOURS = {
    "euler": "#b0b0b0", "semi_implicit_euler": "#7a7a7a", "midpoint": "#e0a458", "heun": "#b5651d",
    "rk4": "#0b5fa5", "nystrom4": "#33b5c4", "dopri5": "#3a7d44", "dop853": "#7b2d8e",
    "implicit": "#d1495b",
}  # fmt: skip


def draw(results: dict[str, Any], path: Path) -> None:
    """Draw the results into a PNG file."""
    names = [p["name"] for p in results["about"]["problems"]]
    panels = [name for name in PANELS if name in names]
    count = len(panels) + 1
    columns = min(4, count)
    with mpl.rc_context(STYLE):
        figure, axes = plt.subplots(
            -(-count // columns), columns, figsize=(3.3 * columns, 3.2 * -(-count // columns)),
            squeeze=False,
        )  # fmt: skip
        for axis, name in zip(axes.flat, panels, strict=False):
            _steps(axis, results, name)
        _asked(axes.flat[len(panels)], results)
        for axis in axes.flat[count:]:
            axis.set_axis_off()
        lines = {line.get_label(): line for axis in axes.flat[:-1] for line in axis.get_lines()}
        lines = {label: lines[label] for label in COLOURS if label in lines}
        figure.legend(lines.values(), lines, loc="lower center", ncols=len(lines),
                      bbox_to_anchor=(0.5, -0.04))  # fmt: skip
        figure.tight_layout()
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, bbox_inches="tight", metadata={"Software": None})
        plt.close(figure)


def _steps(axis: Any, results: dict[str, Any], name: str) -> None:
    problem = next(p for p in results["about"]["problems"] if p["name"] == name)
    for k, (method, colour) in enumerate(COLOURS.items()):
        line = [r for r in results["fixed"] if (r["problem"], r["method"]) == (name, method)]
        line = [r for r in line if r["error"]]
        axis.plot(
            [r["step_s"] for r in line], [r["error"] for r in line], marker=MARKS[k],
            color=colour, markersize=3.5, linewidth=1.2, label=method,
        )  # fmt: skip
    axis.axhline(problem["gate"], color="black", linewidth=0.8, linestyle=":")
    axis.set(xscale="log", yscale="log", ylim=(1e-16, 10), xlabel="step [s]",
             ylabel="largest error [rad] or [m]",
             title=f"{name}, {problem['duration_s']:g} s")  # fmt: skip


def _asked(axis: Any, results: dict[str, Any]) -> None:
    """All problems, error control with ticks long enough that it decides."""
    rows = [r for r in results["controlled"] if r["tick_s"] == TICKS[1] and r["error"]]
    for name in dict.fromkeys(r["problem"] for r in rows):
        for method in CONTROLLED[:2]:
            line = [r for r in rows if (r["problem"], r["method"]) == (name, method)]
            axis.plot(
                [r["tolerance"] for r in line], [r["error"] for r in line], marker=".",
                markersize=4, linewidth=0.8, color=COLOURS[method], alpha=0.7,
                linestyle=":" if name == "long pendulum" else "-", label=f"_{name}",
            )  # fmt: skip
    ends = np.array([TOLERANCES[-1], TOLERANCES[0]])
    axis.plot(ends, ends, color="black", linewidth=0.8, label="_asked")
    axis.set(xscale="log", yscale="log", xlabel=f"tolerance, ticks of {TICKS[1]:g} s",
             ylabel="largest error [rad] or [m]",
             title="error control, all problems")  # fmt: skip
