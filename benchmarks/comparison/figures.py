# SPDX-License-Identifier: Apache-2.0
"""The figures of the report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.peers.base import OURS
from benchmarks.reporting.style import MARKS, STYLE
from benchmarks.studies.bench import Record

COLOURS = {
    OURS: "#0b5fa5", "MuJoCo": "#d1495b", "Drake": "#3a7d44",
    "SciPy": "#7b5ea7", "Pinocchio": "#555555", "Exudyn": "#c98a1b",
    "Newton": "#4f9d9d",
}  # fmt: skip
SHADES = mpl.colormaps["Blues"]


def draw(results: Record, out: Path) -> dict[str, str]:
    """Draw what the results hold."""
    files: dict[str, str] = {}
    with mpl.rc_context(STYLE):
        for study, painter in PAINTERS.items():
            if study in results:
                for name, figure in painter(results[study]).items():
                    file = f"{name}.png"
                    figure.savefig(out / file, bbox_inches="tight", metadata={"Software": None})
                    plt.close(figure)
                    files[f"{study}:{name}"] = file
    return files


def _work_precision(found: Record) -> dict[str, Any]:
    points = found["points"]
    return {
        f"work_precision_{robot.lower().replace(' ', '_')}": _robot(points, robot)
        for robot in dict.fromkeys(p["robot"] for p in points)
    }


def _robot(points: list[Record], robot: str) -> Any:
    here = [p for p in points if p["robot"] == robot]
    scenarios = list(dict.fromkeys(p["scenario"] for p in here))
    figure, axes = plt.subplots(1, len(scenarios), figsize=(6.0 * len(scenarios), 5.2))
    for axis, scenario in zip(axes, scenarios, strict=True):
        _curves(axis, [p for p in here if p["scenario"] == scenario])
        duration = next(p["duration_s"] for p in here if p["scenario"] == scenario)
        axis.set(
            xscale="log", yscale="log", title=f"{robot}: {scenario}",
            xlabel=f"processor time for {duration:g} s of motion [ms]",
            ylabel="largest error of a joint position [rad]",
        )  # fmt: skip
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="center left", bbox_to_anchor=(0.99, 0.5))
    figure.tight_layout()
    return figure


def _curves(axis: Any, points: list[Record]) -> None:
    for family in dict.fromkeys(p["family"] for p in points):
        methods = dict.fromkeys(p["method"] for p in points if p["family"] == family)
        shades = SHADES(np.linspace(0.45, 1.0, len(methods)))
        for k, method in enumerate(methods):
            line = [p for p in points if (p["family"], p["method"]) == (family, method)]
            line = [p for p in line if p["error_rad"]]
            ours = family == OURS
            axis.plot(
                [p["cpu_s"] * 1e3 for p in line], [p["error_rad"] for p in line],
                marker=MARKS[k % len(MARKS)], markersize=4 if ours else 3.5,
                color=shades[k] if ours else COLOURS.get(family, "black"),
                linewidth=1.4 if ours else 1.0, linestyle="-" if ours else "--",
                markerfacecolor=None if ours else "white", label=f"{family} {method}",
            )  # fmt: skip


def _cost(found: Record) -> dict[str, Any]:
    growth = found["growth"]
    _, axis = plt.subplots(figsize=(6.0, 4.2))
    whos = list(dict.fromkeys(g["who"] for g in growth))
    for k, who in enumerate(whos):
        line = [g for g in growth if g["who"] == who]
        axis.plot([g["joints"] for g in line], [g["ns"] for g in line], **_look(k, who, whos))
    joints = sorted({g["joints"] for g in growth})
    axis.set(
        xscale="log", yscale="log", xlabel="joints of the chain", title="Cost of more joints",
        ylabel="processor time of one step or evaluation [ns]", xticks=joints, xticklabels=joints,
    )  # fmt: skip
    axis.minorticks_off()
    return {"joints": _legend_beside(axis)}


def _features(found: Record) -> dict[str, Any]:
    rows = found["rows"][::-1]
    figure, axis = plt.subplots(figsize=(6.5, 0.35 * len(rows) + 1))
    axis.barh([r["scene"] for r in rows], [r["ns"] for r in rows], color=COLOURS[OURS], height=0.6)
    for k, r in enumerate(rows):
        axis.text(r["ns"], k, f" {r['operations']} operations", va="center", fontsize=7)
    axis.set(xlabel="one RK4 step [ns]", title="What each feature costs")
    axis.margins(x=0.2)
    axis.grid(axis="y", visible=False)
    return {"features": figure}


def _rollouts(found: Record) -> dict[str, Any]:
    _, axis = plt.subplots(figsize=(6.0, 4.0))
    rows = [
        r for r in found["rows"] if (r["robot"], r["threads"]) == (found["rows"][0]["robot"], 1)
    ]
    whos = list(dict.fromkeys(r["who"] for r in rows))
    for k, who in enumerate(whos):
        line = [r for r in rows if r["who"] == who]
        rates = [r["arm_steps_per_s_per_core"] / 1e6 for r in line]
        axis.plot([r["arms"] for r in line], rates, **_look(k, who, whos))
    axis.set(
        xscale="log", yscale="log", xlabel="arms in one call",
        ylabel="million arm-steps per second and core", title=f"Rollouts, {rows[0]['robot']}",
    )  # fmt: skip
    return {"rollouts": _legend_beside(axis)}


def _energy(found: Record) -> dict[str, Any]:
    _, axis = plt.subplots(figsize=(6.0, 4.6))
    rows = [r | {"label": f"{r['who']}, {r['knob']} {r['setting']:g}"} for r in found["rows"]]
    labels = list(dict.fromkeys(r["label"] for r in rows))
    for k, label in enumerate(labels):
        line = [r for r in rows if r["label"] == label and r["drift_J"]]
        axis.plot([r["horizon_s"] for r in line], [r["drift_J"] for r in line],
                  **_look(k, label, labels))  # fmt: skip
    axis.set(
        xscale="log", yscale="log", xlabel="time simulated [s]", title="Free, frictionless Panda",
        ylabel="largest energy error so far [J]",
    )  # fmt: skip
    axis.set_ylim(top=min(axis.get_ylim()[1], 1e4))
    return {"energy": _legend_beside(axis)}


def _startup(found: Record) -> dict[str, Any]:
    rows = sorted((r for r in found["rows"] if "Chain" in r["robot"]), key=lambda r: r["joints"])
    figure, axis = plt.subplots(figsize=(6.5, 3.6))
    for key, label, look in (("cold_s", "empty cache", "o--"), ("cached_s", "cached", "o-")):
        axis.plot([r["joints"] for r in rows], [r[key]["total without imports"] for r in rows],
                  look, color=COLOURS[OURS], markersize=4, label=label)  # fmt: skip
    axis.set(yscale="log", xlabel="joints of the chain", ylabel="scene to first step [s]",
             title="Start-up")  # fmt: skip
    axis.legend()
    return {"startup": figure}


def _look(k: int, who: str, whos: list[str]) -> dict[str, Any]:
    """Ours in shades of blue, solid; peers in their colour, dashed."""
    mark = {"marker": MARKS[k % len(MARKS)], "markersize": 4, "label": who}
    ours = [w for w in whos if w.startswith(OURS)]
    if who in ours:
        shade = SHADES(np.linspace(0.45, 1.0, len(ours))[ours.index(who)])
        return mark | {"color": shade, "linestyle": "-"}
    colour = next((c for family, c in COLOURS.items() if who.startswith(family)), "black")
    return mark | {"color": colour, "linestyle": "--", "markerfacecolor": "white"}


def _legend_beside(axis: Any) -> Any:
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return axis.figure


PAINTERS: dict[str, Callable[[Record], dict[str, Any]]] = {
    "work_precision": _work_precision,
    "cost": _cost,
    "features": _features,
    "rollouts": _rollouts,
    "energy": _energy,
    "startup": _startup,
}
