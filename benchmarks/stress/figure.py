# SPDX-License-Identifier: Apache-2.0
"""The figure: stable runs of each method and their errors, by step times rate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from arm_sim.figures import WIDTH, figure
from benchmarks.reporting.style import MARKS, METHODS
from benchmarks.stress.judge import SURVIVED, Result
from benchmarks.stress.tables import Point, fixed

HALF_DECADES = 10.0 ** np.arange(-4.0, 2.1, 0.5)
FEWEST = 4  # runs that make a point
ROUNDING = 1e-16  # nothing below it is drawn


def draw(found: Sequence[Result], path: Path) -> None:
    """Draw what was found with fixed steps and without dry friction.

    Args:
        found: all runs.
        path: of the picture.
    """
    points = fixed(found)
    with figure(path, 1, 2, (WIDTH, 3.4)) as axes:
        shares, errors = axes
        for mark, (key, name) in zip(MARKS, METHODS.items(), strict=False):
            mine = [point for point in points if point[1].name == key]
            shares.plot(*_share(mine), marker=mark, label=name)
            errors.plot(*_error(mine), marker=mark)
        for axis in (shares, errors):
            axis.set(xscale="log", xlim=HALF_DECADES[[0, -1]],
                     xlabel="step × fastest rate of the arm")  # fmt: skip
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
