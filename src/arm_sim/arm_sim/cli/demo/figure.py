# SPDX-License-Identifier: Apache-2.0
"""The figure of a demo run: position, tracking error and torque over time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from arm_sim.cli.demo.observer import Seen
from arm_sim.cli.output import units
from arm_sim.figures import legend_at_right

_STYLE = {
    "font.size": 9.5, "axes.titlesize": 10, "axes.titlelocation": "left",
    "axes.titleweight": "bold", "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "axes.axisbelow": True,
    "grid.color": "#e4e6ea", "grid.linewidth": 0.8, "axes.edgecolor": "#8a8f98",
    "xtick.color": "#555a63", "ytick.color": "#555a63", "legend.frameon": False,
}  # fmt: skip
_DOTS = 45  # number of service answers that are drawn


def draw(
    file: Path, seen: Seen, names: Sequence[str], types: Sequence[str], duration: float, title: str
) -> None:
    """Draw a PNG; ``types`` are the joint types, ``duration`` is that of the motion in [s]."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 8.0), layout="constrained")
        axes = figure.subplots(
            3, 1, sharex=True, gridspec_kw={"height_ratios": (1.15, 0.85, 1.15)}
        )
        colors = matplotlib.colormaps["tab10" if len(names) <= 10 else "tab20"].colors
        for axis in axes:
            axis.set_prop_cycle(color=colors)
        _positions(axes[0], seen, types)
        _errors(axes[1], seen, types)
        _torques(axes[2], seen, types, colors)
        axes[2].set_xlabel("time [s]")
        axes[2].set_xlim(0.0, max(duration, float(seen.time[-1])))
        lines = axes[0].lines[: len(names)]
        short = [_short(name, names) for name in names]
        legend_at_right(figure, lines, short, loc="center right", handlelength=1.2)
        figure.align_ylabels(axes)
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
        figure.savefig(file, dpi=130)


def _positions(axis: Any, seen: Seen, types: Sequence[str]) -> None:
    axis.plot(seen.time, seen.position, linewidth=1.8)
    axis.plot(seen.time, seen.reference, color="#1c1f24", linewidth=0.7, dashes=(4, 3))
    axis.set_title("Position; dashed: reference")
    axis.set_ylabel(f"position [{units(types, 'rad', 'm')}]")


def _errors(axis: Any, seen: Seen, types: Sequence[str]) -> None:
    scale, prefix = _prefix(float(np.abs(seen.error).max()))
    axis.plot(seen.time, scale * seen.error, linewidth=1.1)
    axis.set_title("Tracking error: reference minus position")
    axis.set_ylabel(f"error [{units(types, prefix + 'rad', prefix + 'm')}]")


def _torques(axis: Any, seen: Seen, types: Sequence[str], colors: Any) -> None:
    axis.plot(seen.time, seen.effort, linewidth=1.4)
    every = max(1, len(seen.asked_time) // _DOTS)
    for joint, torque in enumerate(seen.asked_effort.T):
        axis.plot(
            seen.asked_time[::every], torque[::every], linestyle="", marker="o", markersize=3.0,
            markerfacecolor="white", markeredgewidth=0.9,
            markeredgecolor=colors[joint % len(colors)],
        )  # fmt: skip
    axis.set_title("Commanded torque; circles: answers of the dynamics service for the reference")
    axis.set_ylabel(f"torque [{units(types, 'N m', 'N')}]")


def _prefix(largest: float) -> tuple[float, str]:
    """A factor and its SI prefix that make numbers readable."""
    for scale, prefix in ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n")):
        if scale * largest >= 1.0:
            return scale, prefix
    return 1e12, "p"


def _short(name: str, names: Sequence[str]) -> str:
    """The name without the common prefix of all names."""
    common = os.path.commonprefix(names) if len(names) > 1 else ""
    return name[max(common.rfind("_"), common.rfind("/")) + 1 :]
