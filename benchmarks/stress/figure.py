# SPDX-License-Identifier: Apache-2.0
"""The figure: survival by method and step, survival and error by step times rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from benchmarks.reporting.style import MARKS, STYLE
from benchmarks.stress.judge import SURVIVED, Result
from benchmarks.stress.tables import Point, fixed, names_of, runs

HALF_DECADES = 10.0 ** np.arange(-4.0, 2.1, 0.5)
FEWEST = 4  # runs that make a point
ROUNDING = 1e-16  # nothing below it is drawn


def draw(found: Sequence[Result], path: Path) -> None:
    """Draw what was found.

    Args:
        found: all runs.
        path: of the picture.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        figure, axes = plt.subplots(1, 3, figsize=(15, 4.8), width_ratios=(1.1, 1, 1))
        _heat_map(axes[0], runs(found))
        _curves(axes[1], axes[2], fixed(found))
        figure.tight_layout()
        figure.savefig(path, bbox_inches="tight", metadata={"Software": None})
        plt.close(figure)


def _heat_map(axis: Any, results: Sequence[Result]) -> None:
    names = names_of(results)
    steps = sorted({r.dt for r in results}, reverse=True)
    share = np.array([[_survival([r for r in results if (r.name, r.dt) == (name, dt)])
                       for dt in steps] for name in names])  # fmt: skip
    axis.imshow(share, cmap="RdYlGn", vmin=0, vmax=1, aspect="auto")
    for row, column in np.ndindex(share.shape):
        axis.text(column, row, f"{share[row, column]:.0%}", ha="center", va="center", fontsize=8)
    axis.set_xticks(range(len(steps)), [f"{dt:g} s" for dt in steps])
    axis.set_yticks(range(len(names)), names)
    axis.grid(visible=False)
    axis.set(title="Runs that survive", xlabel="tick")


def _curves(shares: Any, errors: Any, points: Sequence[Point]) -> None:
    names = names_of([r for _, r, _ in points])
    colours = mpl.colormaps["turbo"](np.linspace(0.05, 0.95, len(names)))
    for k, name in enumerate(names):
        style = {"marker": MARKS[k % len(MARKS)], "markersize": 4, "color": colours[k]}
        mine = [point for point in points if point[1].name == name]
        shares.plot(*_share(mine), label=name, **style)
        errors.plot(*_error(mine), label=name, **style)
    for axis, title, label in (
        (shares, "Survival, fixed steps, no dry friction", "runs that survive [%]"),
        (errors, "Error where they survive, steady motions", "median error of q / (1 + |q|)"),
    ):
        axis.set(xscale="log", xlim=HALF_DECADES[[0, -1]], title=title, ylabel=label,
                 xlabel="step × fastest rate of the arm")  # fmt: skip
    shares.set(ylim=(-3, 103))
    errors.set(yscale="log", ylim=(ROUNDING / 2, 10))
    shares.legend(loc="lower left")


def _share(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    groups = _grouped([(x, r) for x, r, _ in points])
    return list(groups), [100 * _survival(some) for some in groups.values()]


def _error(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    good = [(x, r) for x, r, steady in points if steady and r.outcome == SURVIVED]
    groups = _grouped(good)
    middle = [np.median([r.error for r in some if r.error is not None])
              for some in groups.values()]  # fmt: skip
    return list(groups), [max(float(error), ROUNDING) for error in middle]


def _grouped(points: Sequence[tuple[float, Result]]) -> dict[float, list[Result]]:
    groups = {}
    for low, high in zip(HALF_DECADES[:-1], HALF_DECADES[1:], strict=True):
        some = [r for x, r in points if low <= x < high]
        if len(some) >= FEWEST:
            groups[float(np.sqrt(low * high))] = some
    return groups


def _survival(some: Sequence[Result]) -> float:
    return sum(r.outcome == SURVIVED for r in some) / len(some) if some else np.nan
