# SPDX-License-Identifier: Apache-2.0
"""Tables in files, and their figures."""

import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pictures import written

from arm_dynamics import InvalidInput
from arm_studies.sweeps import Sweep, load_study, sweep
from arm_studies.sweeps.figures import draw
from arm_studies.sweeps.table import Table

STUDY: dict[str, Any] = {
    "scene": "two_link", "duration": 0.05,
    "vary": {"controller": ["pd", "float"], "gravity": [[0, 0, -9.81], [0, 0, 0]]},
}  # fmt: skip


@pytest.fixture(scope="module")
def done() -> Sweep:
    return sweep(STUDY, workers=1)


def test_printed_it_is_a_summary(done: Sweep) -> None:
    assert f"energy: median {np.median(done.table['energy']):.4g}, from " in f"{done!r}"


@pytest.mark.group("sweep")
def test_parquet_has_the_same_bits(done: Sweep, tmp_path: Path) -> None:
    from pyarrow import parquet

    path = done.table.save(tmp_path)
    assert path == tmp_path / "table.parquet"
    read = parquet.read_table(path).to_pydict()
    assert read == {name: column.tolist() for name, column in done.table.columns.items()}
    first = path.read_bytes()
    done.table.save(tmp_path)
    assert path.read_bytes() == first


def test_without_pyarrow_it_is_csv(
    done: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with done.table.save(tmp_path).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["energy"]) for row in rows] == done.table["energy"].tolist()
    assert [row["gravity"] for row in rows] == ["[0, 0, -9.81]", "[0, 0, 0]"] * 2


def test_columns_are_selected_by_name(done: Sweep) -> None:
    assert len(done.table) == 4 and done.table.done.all()
    allowed = "unknown column 'enrgy'; allowed: .*did you mean 'energy'"
    with pytest.raises(InvalidInput, match=allowed):
        done.table["enrgy"]


def test_figures_of_a_sweep_show_each_group_over_each_number(tmp_path: Path) -> None:
    damping = "joints.elbow.friction.viscous"
    varied = {"controller": ["pd", "float"], damping: {"log_uniform": [0.001, 1.0]}}
    study = load_study({"scene": "two_link", "duration": 0.1, "vary": varied})
    columns = {
        "run": np.arange(4),
        "controller": np.array(["pd", "float", "pd", "float"]),
        damping: np.array([0.001, 0.01, 0.1, 1.0]),
        "tracking_rms": np.array([4.0, 1.0, 2.0, np.nan]),
        "energy": np.array([1.0, 10.0, 100.0, 1000.0]),
        "saturation": np.zeros(4),  # nothing to see
    }
    table = Table(columns, tuple(varied), ("tracking_rms", "energy", "saturation"))
    with written() as figures:
        paths = draw(study, table, tmp_path)
    assert paths == [tmp_path / "scatter.png", tmp_path / "distribution.png"]
    (tracking, energy), (first, second) = (figure.axes for figure in figures)
    assert tracking.get_ylabel() == "RMS tracking error\n[rad]"
    assert energy.get_xlabel() == "elbow viscous friction\n[N m s/rad]"
    assert [axis.get_yscale() for axis in (tracking, energy)] == ["linear", "log"]
    assert energy.get_xscale() == "log"
    pd, float_ = (points.get_offsets() for points in tracking.collections)
    assert pd.tolist() == [[0.001, 4.0], [0.1, 2.0]] and float_[0].tolist() == [0.01, 1.0]
    assert first.get_ylabel() == "runs below [%]" and second.get_xscale() == "log"
    pd, float_ = (line.get_xydata().tolist() for line in first.lines)
    assert pd == [[2.0, 50.0], [4.0, 100.0]] and float_ == [[1.0, 100.0]]
