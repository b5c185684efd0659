# SPDX-License-Identifier: Apache-2.0
"""Figures of a sweep: metrics over varied quantities, and their distributions."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.arrays import Array
from arm_sim.figures import WIDTH, figure, units
from arm_studies.sweeps.metrics import METRICS
from arm_studies.sweeps.quantities import heading
from arm_studies.sweeps.study import Study
from arm_studies.sweeps.table import Table

_MOST = 5  # rows and columns of a figure, and curves in it
_DECADES = 10.0  # ratio of the ends above which an axis is logarithmic
_MARKS = "o^sDv"  # of the curves
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
    without_unit = [name for name in metrics if METRICS[name.partition(".")[0]].unit == "1"]
    table = replace(table, columns=table.columns | {k: 100.0 * table[k] for k in without_unit})
    files, axes_of = [], dict(zip(metrics, _headings(study, metrics), strict=True))
    numbers = [name for name in table.varied if table[name].dtype.kind == "f"]
    numbers = [name for name in numbers if np.ptp(table[name]) > 0.0][:_MOST]
    if numbers:
        spread = {name for name, varied in study.vary.items() if varied.log_uniform is not None}
        files.append(_scatter(table, axes_of, numbers, spread, folder / "scatter.png"))
    files.append(_distribution(table, axes_of, folder / "distribution.png"))
    return files


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
    table: Table, metrics: dict[str, str], numbers: list[str], spread: set[str], path: Path
) -> Path:
    dots: dict[str, Any] = {"s": 2.0 if len(table) > _MANY else 14.0, "alpha": 0.6, "lw": 0}
    size = min(WIDTH, 3.4 * len(numbers)), 1.8 * len(metrics) + 0.7
    shared: dict[str, Any] = {"sharex": "col", "sharey": "row", "squeeze": False}
    with figure(path, len(metrics), len(numbers), size, **shared) as axes:
        for row, (metric, words) in zip(axes, metrics.items(), strict=True):
            for at, name in zip(row, numbers, strict=True):
                for (label, runs), mark in zip(_some(table).items(), _MARKS, strict=False):
                    x, y = table[name][runs], table[metric][runs]
                    at.scatter(x, y, marker=mark, label=label, **dots)
                _scale(at.set_yscale, table[metric])
                if name in spread:
                    _scale(at.set_xscale, table[name])
            row[0].set_ylabel(words)
        for at, name in zip(axes[-1], numbers, strict=True):
            at.set_xlabel(heading(name))
    return path


def _distribution(table: Table, metrics: dict[str, str], path: Path) -> Path:
    size = min(WIDTH, 3.4 * len(metrics)), 2.5
    with figure(path, 1, len(metrics), size, squeeze=False, sharey=True) as axes:
        for at, (metric, words) in zip(axes[0], metrics.items(), strict=True):
            for label, runs in _some(table).items():
                values = np.sort(_finite(table[metric][runs]))
                share = np.arange(1, len(values) + 1) / max(1, len(values))
                at.step(values, 100 * share, where="post", label=label)
            _scale(at.set_xscale, table[metric])
            at.set_xlabel(words)
        axes[0, 0].set_ylabel("runs below [%]")
    return path


def _some(table: Table) -> dict[str, NDArray[np.bool_]]:
    """The first groups, as many as a figure has colours for, by labels as "PD + gravity"."""
    labels = {}
    for name, runs in list(groups(table).items())[:_MOST]:
        label = name.replace("pd_gravity", "pd + gravity").replace("_", " ")
        labels[re.sub(r"\bpi?d\b", lambda match: match[0].upper(), label)] = runs
    return labels


def _headings(study: Study, metrics: list[str]) -> list[str]:
    """Metrics in words, with their joints and units."""
    words, types = [], ArmModel(load_scene(study.scene)).joint_types
    for key, _, joint in (metric.partition(".") for metric in metrics):
        turning, *sliding = METRICS[key].unit.replace("1", "%").split(", ")
        unit = units(types, turning, *sliding) if sliding else turning
        words.append(f"{METRICS[key].name}{f' of {joint}' if joint else ''}\n[{unit}]")
    return words


def _finite(values: Array) -> Array:
    finite: Array = values[np.isfinite(values)]
    return finite if finite.size else np.zeros(1)


def _scale(choose: Callable[[str], object], values: Array) -> None:
    """Use a logarithmic axis for values that span decades."""
    finite = _finite(values)
    if finite.min() > 0.0 and finite.max() > _DECADES * finite.min():
        choose("log")
