# SPDX-License-Identifier: Apache-2.0
"""Figures of a sweep: metrics over varied quantities, and their distributions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_sim.figures import drawn
from arm_studies.sweeps.metrics import METRICS
from arm_studies.sweeps.study import Study
from arm_studies.sweeps.table import Table

_MOST = 5  # rows and columns of a figure, and curves in it
_DECADES = 10.0  # ratio of the ends above which an axis is logarithmic
_MANY = 2000  # number of points above which markers are small


def draw(study: Study, table: Table, folder: Path) -> list[Path]:
    """Draw the figures of a sweep.

    Args:
        study: The study.
        table: Its table.
        folder: Folder of the figures.

    Returns:
        ``scatter.png``, metrics over quantities, if a number is varied; and ``distribution.png``,
        the share of runs below each value.
    """
    metrics = [name for name in table.metrics if np.ptp(_finite(table[name])) > 0.0][:_MOST]
    if not metrics:
        return []
    made = []
    numbers = [name for name in table.varied if table[name].dtype.kind == "f"]
    numbers = [name for name in numbers if np.ptp(table[name]) > 0.0][:_MOST]
    if numbers:
        spread = {name for name, varied in study.vary.items() if varied.log_uniform is not None}
        made.append(_scatter(table, metrics, numbers, spread, folder / "scatter.png"))
    made.append(_distribution(table, metrics, folder / "distribution.png"))
    return made


def groups(table: Table) -> dict[str, NDArray[np.bool_]]:
    """Runs grouped by categorical quantities, such as scenes or controllers; else one group."""
    words = [name for name in table.varied if table[name].dtype.kind != "f"]
    if not words:
        return {"": np.ones(len(table), dtype=bool)}
    rows = list(zip(*(table[name].tolist() for name in words), strict=True))
    return {
        ", ".join(row): np.array([other == row for other in rows]) for row in dict.fromkeys(rows)
    }


def _scatter(
    table: Table, metrics: list[str], numbers: list[str], spread: set[str], path: Path
) -> Path:
    size = 2.0 if len(table) > _MANY else 9.0
    with _small_axes(path, len(metrics), len(numbers)) as axes:
        for row, metric in zip(axes, metrics, strict=True):
            for at, name in zip(row, numbers, strict=True):
                for label, these in _some(table).items():
                    x, y = table[name][these], table[metric][these]
                    at.scatter(x, y, s=size, alpha=0.6, linewidths=0, label=label or None)
                _scale(at.set_yscale, table[metric])
                if name in spread:
                    _scale(at.set_xscale, table[name])
            row[0].set_ylabel(_heading(metric))
        for at, name in zip(axes[-1], numbers, strict=True):
            at.set_xlabel(name)
        if len(groups(table)) > 1:
            axes[0, 0].legend(fontsize=8, markerscale=2.0)
    return path


def _distribution(table: Table, metrics: list[str], path: Path) -> Path:
    with _small_axes(path, 1, len(metrics)) as axes:
        for at, metric in zip(axes[0], metrics, strict=True):
            for label, these in _some(table).items():
                values = np.sort(_finite(table[metric][these]))
                share = np.arange(1, len(values) + 1) / max(1, len(values))
                at.step(values, share, where="post", label=label or None)
            _scale(at.set_xscale, table[metric])
            at.set_xlabel(_heading(metric))
        axes[0, 0].set_ylabel("share of runs below")
        if len(groups(table)) > 1:
            axes[0, 0].legend(fontsize=8)
    return path


def _some(table: Table) -> dict[str, NDArray[np.bool_]]:
    return dict(list(groups(table).items())[:_MOST])


def _heading(metric: str) -> str:
    unit = METRICS[metric.partition(".")[0]].unit
    return metric if unit == "1" else f"{metric} [{unit}]"


def _finite(values: Array) -> Array:
    found: Array = values[np.isfinite(values)]
    return found if found.size else np.zeros(1)


def _scale(choose: Callable[[str], object], values: Array) -> None:
    """Use a logarithmic axis for values that span decades."""
    finite = _finite(values)
    if finite.min() > 0.0 and finite.max() > _DECADES * finite.min():
        choose("log")


def _small_axes(path: Path, rows: int, columns: int) -> AbstractContextManager[Any]:
    return drawn(path, rows, columns, (3.3 * columns + 0.6, 2.4 * rows + 0.5))
