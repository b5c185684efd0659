# SPDX-License-Identifier: Apache-2.0
"""Figures of the comparison."""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.ndimage import maximum_filter1d

from arm_sim.figures import COLORS, WIDTH, figure
from benchmarks.controllers.cases import PACES, PLANTS
from benchmarks.controllers.contenders import CONTENDERS
from benchmarks.controllers.measure import Result

_MARKS = ("o", "s", "^", "D")
_LEAST = 1e-3  # [mm] where the logarithmic axes begin
_ALIKE = ("PD", "PID", "operational space", "joint impedance")  # of no course of their own
_LINES = ("-", "-", "-", (0, (4, 4)), "-")  # of courses: where some coincide, all are seen
_WINDOW = 0.1  # [s] of which a course shows the largest error


def draw(results: Sequence[Result], folder: Path) -> list[Path]:
    """Draw two figures for each arm into a folder, and return their files."""
    written = []
    for arm in dict.fromkeys(r.arm for r in results):
        mine = [r for r in results if r.arm == arm]
        for name, paint in (("errors", _errors), ("courses", _courses)):
            written.append(folder / f"compare_controllers_{arm}_{name}.png")
            paint(mine, written[-1])
    return written


def _names(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(result.controller for result in results))


def _errors(results: Sequence[Result], path: Path) -> None:
    """A dot for each case: controllers as rows, plants by colour."""
    with figure(path, 2, 2, (WIDTH, 5.8), sharex=True, sharey=True) as axes:
        for column, pace in enumerate(PACES):
            line = [r for r in results if r.pace == pace and r.task == "line"]
            _dots(axes[0, column], line, [r.error for r in line])
            axes[0, column].set(title=f"{line[0].title}, {pace} line", xlabel="largest error [mm]")
            point = [r for r in results if r.pace == pace and r.task == "regulation"]
            _dots(axes[1, column], point, [r.final for r in point])
            how = "set-point moved in 1.5 s" if pace == "slow" else "set-point stepped"
            axes[1, column].set(title=f"{line[0].title}, {how}", xlabel="error at the end [mm]")


def _dots(axis: Axes, results: Sequence[Result], values: Sequence[float]) -> None:
    names = _names(results)
    for i, (plant, color) in enumerate(zip(PLANTS, COLORS, strict=False)):
        for mine in (False, True):  # what is below the least is drawn open
            rows = [(names.index(r.controller), x) for r, x in zip(results, values, strict=True)
                    if r.plant == plant and (x < _LEAST) is mine]  # fmt: skip
            y = [row + 0.18 * (i - 1.5) for row, _ in rows]
            axis.plot([max(x, _LEAST) for _, x in rows], y, _MARKS[i], color=color, ms=4.0,
                      mfc="white" if mine else color, clip_on=not rows, zorder=3,
                      label=None if mine else PLANTS[plant])  # fmt: skip
    axis.plot([], [], "o", color="0.4", mfc="white", ms=4.0, label=f"open: below {_LEAST:g} mm")
    axis.set(xscale="log", xlim=(_LEAST, 2e3), ylim=(len(names) - 0.5, -0.5))
    axis.set_yticks(range(len(names)), names)
    axis.grid(visible=False, axis="y")
    for row in range(1, len(names)):
        axis.axhline(row - 0.5, color="0.9", lw=0.8)


def _courses(results: Sequence[Result], path: Path) -> None:
    """Error over time of the fast line, one panel for each plant."""
    names = [name for name in _names(results) if name not in _ALIKE or name not in CONTENDERS]
    names = names[: len(COLORS)] or _names(results)[: len(COLORS)]
    with figure(path, 2, 2, (WIDTH, 5.2), sharex=True, sharey=True) as axes:
        for axis, plant in zip(np.ravel(axes), PLANTS, strict=True):
            for controller, dashes in zip(names, cycle(_LINES), strict=False):
                key = (plant, "line", "fast", controller)
                mine = next(r for r in results if (r.plant, r.task, r.pace, r.controller) == key)
                width = max(1, round(_WINDOW / np.diff(mine.time[:2])[0]))
                distance = maximum_filter1d(mine.course, width)
                axis.plot(mine.time, distance, ls=dashes, label=controller)
            axis.set(yscale="log", ylim=(_LEAST, 2e2), title=f"{mine.title}: {PLANTS[plant]}")
        for axis in axes[1]:
            axis.set_xlabel("time [s]")
        for axis in axes[:, 0]:
            axis.set_ylabel(f"largest distance\nwithin {_WINDOW:g} s [mm]")
