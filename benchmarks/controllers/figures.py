# SPDX-License-Identifier: Apache-2.0
"""Figures of the comparison."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.controllers.cases import PACES, PLANTS
from benchmarks.controllers.measure import Result

_COLOURS = ("#1b9e77", "#d95f02", "#7570b3", "#e7298a")  # colour-blind safe (ColorBrewer Dark2)
_MARKS = ("o", "s", "^", "D")
_LEAST = 1e-3  # [mm] where the logarithmic axes begin


def draw(results: Sequence[Result], folder: Path) -> list[Path]:
    """Draw two figures for each arm."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for arm in dict.fromkeys(r.arm for r in results):
        mine = [r for r in results if r.arm == arm]
        for name, figure in (("errors", _errors(mine)), ("courses", _courses(mine))):
            path = folder / f"compare_controllers_{arm}_{name}.png"
            figure.savefig(path, dpi=110)
            written.append(path)
    return written


def _names(results: Sequence[Result]) -> list[str]:
    return list(dict.fromkeys(result.controller for result in results))


def _errors(results: Sequence[Result]) -> Figure:
    """A dot for each case: controllers as rows, plants by colour."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    axes = figure.subplots(2, 2, sharey=True)
    figure.suptitle(f"{results[0].title}: errors of the hand")
    for column, pace in enumerate(PACES):
        line = [r for r in results if r.pace == pace and r.task == "line"]
        _dots(axes[0, column], line, [r.error for r in line])
        axes[0, column].set_title(f"Straight line, {pace}: largest distance from the reference")
        point = [r for r in results if r.pace == pace and r.task == "regulation"]
        _dots(axes[1, column], point, [r.final for r in point])
        how = "set-point moved in 1.5 s" if pace == "slow" else "step of the set-point"
        axes[1, column].set_title(f"Regulation, {how}: remaining distance")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _dots(axis: Axes, results: Sequence[Result], values: Sequence[float]) -> None:
    names = _names(results)
    for i, plant in enumerate(PLANTS):
        rows = [(names.index(r.controller), x) for r, x in zip(results, values, strict=True)
                if r.plant == plant]  # fmt: skip
        y = [row + 0.16 * (i - 1.5) for row, _ in rows]
        x = [max(value, _LEAST) for _, value in rows]
        axis.plot(x, y, _MARKS[i], color=_COLOURS[i], label=f"{plant}: {PLANTS[plant]}", ms=5.5)
    axis.set_xscale("log")
    axis.set_xlabel("distance [mm]; at the left edge: below 0.001 mm")
    axis.set_xlim(_LEAST / 1.5, 2e3)
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.grid(axis="x", alpha=0.3)
    for row in range(1, len(names)):
        axis.axhline(row - 0.5, color="0.9", lw=0.8)


def _courses(results: Sequence[Result]) -> Figure:
    """Error over time of the fast line, one panel for each plant."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    figure.suptitle(f"{results[0].title}: fast straight line, distance from the reference")
    names = _names(results)
    shades = [f"C{i % 10}" for i in range(len(names))]
    for axis, plant in zip(np.ravel(axes), PLANTS, strict=True):
        for shade, controller in zip(shades, names, strict=True):
            key = (plant, "line", "fast", controller)
            mine = next(r for r in results if (r.plant, r.task, r.pace, r.controller) == key)
            axis.plot(mine.time, np.maximum(mine.course, _LEAST), color=shade, label=controller)
        axis.set_yscale("log")
        axis.set_ylim(_LEAST, 2e3)
        axis.set_title(f"{plant}: {PLANTS[plant]}")
        axis.grid(alpha=0.3)
    for axis in axes[1]:
        axis.set_xlabel("time [s]")
    for axis in axes[:, 0]:
        axis.set_ylabel("distance [mm]")
    handles = axes[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=5)
    return figure
