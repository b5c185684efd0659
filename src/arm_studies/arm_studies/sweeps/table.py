# SPDX-License-Identifier: Apache-2.0
"""The table of a sweep: a row for each run, in order, and its files."""

import csv
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.exceptions import InvalidInput, choices
from arm_studies.sweeps.design import Point
from arm_studies.sweeps.keys import is_number
from arm_studies.sweeps.runs import DONE, Row
from arm_studies.sweeps.study import Study


@dataclass(frozen=True)
class Table:
    """Columns of equal length.

    Attributes:
        columns: Columns by name: ``run`` and ``sample``, varied quantities by key, metrics,
            ``status`` (``done``, ``diverged`` or ``failed``) and ``note``.
        varied: Names of the varied quantities.
        metrics: Names of the metrics.
    """

    columns: dict[str, NDArray[Any]]
    varied: tuple[str, ...]
    metrics: tuple[str, ...]

    def __repr__(self) -> str:
        """A summary: its size and its columns."""
        return f"<Table: {len(self)} runs; columns: {', '.join(self.columns)}>"

    def __len__(self) -> int:
        """Number of runs."""
        return len(self.columns["run"])

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column by its name, or raise InvalidInput."""
        if name not in self.columns:
            raise InvalidInput(f"unknown column '{name}'; allowed: {choices(name, self.columns)}")
        return self.columns[name]

    @property
    def done(self) -> NDArray[np.bool_]:
        """Which runs were completed."""
        return np.asarray(self.columns["status"] == DONE)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Write ``table.parquet``, or ``table.csv`` where pyarrow is not installed.

        Returns:
            Path of the file.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        try:
            import pyarrow
            from pyarrow import parquet
        except ModuleNotFoundError:
            path = folder / "table.csv"
            with path.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(self.columns)
                columns = (column.tolist() for column in self.columns.values())
                writer.writerows(zip(*columns, strict=True))
            return path
        path = folder / "table.parquet"
        parquet.write_table(pyarrow.table({k: v.tolist() for k, v in self.columns.items()}), path)
        return path


def table_of(study: Study, runs: Sequence[Point], rows: Mapping[int, Row]) -> Table:
    """The table of a study whose runs are complete."""
    ordered = [rows[run.index] for run in runs]
    columns: dict[str, NDArray[Any]] = {
        "run": np.array([run.index for run in runs]),
        "sample": np.array([run.sample for run in runs]),
    }
    columns |= {key: _column([run.values[key] for run in runs]) for key in study.vary}
    for i, name in enumerate(study.metrics):
        columns[name] = np.array([row.metrics[i] for row in ordered])
    columns |= {k: np.array([getattr(row, k) for row in ordered]) for k in ("status", "note")}
    return Table(columns, tuple(study.vary), study.metrics)


def _column(values: list[Any]) -> NDArray[Any]:
    """Numbers if all values are; else text, with lists and mappings as JSON."""
    if all(map(is_number, values)):
        return np.array(values, dtype=float)
    return np.array([value if isinstance(value, str) else json.dumps(value) for value in values])
