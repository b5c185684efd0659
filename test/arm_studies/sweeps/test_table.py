# SPDX-License-Identifier: Apache-2.0
"""Tables in files, and the remaining time."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pictures import written

from arm_dynamics import InvalidInput
from arm_studies.sweeps import Sweep, load_study, sweep
from arm_studies.sweeps.figures import draw, groups
from arm_studies.sweeps.pace import Pace
from arm_studies.sweeps.sharing import Result
from arm_studies.sweeps.table import Table
from arm_studies.sweeps.world import Row

STUDY: dict[str, Any] = {
    "scene": "two_link", "duration": 0.05,
    "vary": {"controller": ["pd", "float"], "gravity": [[0, 0, -9.81], [0, 0, 0]]},
}  # fmt: skip


@pytest.fixture(scope="module")
def done() -> Sweep:
    return sweep(STUDY, workers=1)


def test_runs_are_grouped_by_everything_that_is_no_number(done: Sweep) -> None:
    found = groups(done.table)
    assert [mask.tolist() for mask in found.values()] == np.eye(4, dtype=bool).tolist()
    assert [name.split(", ")[0] for name in found] == ["pd", "pd", "float", "float"]


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


def result(kind: str, count: int, seconds: float) -> Result:
    rows = tuple(Row(k, "done", "", ()) for k in range(count))
    return Result(rows, kind, seconds, 0.0)


def test_the_remaining_time_is_that_of_the_runs_to_come() -> None:
    """Two workers; runs of one kind cost 1 s of a worker, those of the other 10 s."""
    pace = Pace({"quick": 10, "slow": 5})
    assert pace.remaining(0.0) is None
    now = 100.0  # what happened before the first result does not count
    pace.note(result("quick", 2, 2.0), now)
    assert pace.remaining(now) is None, "too little is known"
    for _ in range(2):
        now += 1.0
        pace.note(result("quick", 2, 2.0), now)
    pace.note(result("slow", 1, 10.0), now + 5.0)
    assert pace.remaining(now + 5.0) == pytest.approx((4 * 1.0 + 4 * 10.0) / 2)


def test_a_kind_of_which_nothing_is_known_is_taken_for_the_others() -> None:
    pace = Pace({"quick": 8, "slow": 4})
    for k in range(4):
        pace.note(result("quick", 2, 2.0), float(k))
    assert pace.remaining(3.0) == pytest.approx(4 * 1.0 / 2.0)
    assert np.isfinite(pace.remaining(3.0) or np.inf)


def drawn(columns: dict[str, Any], varied: dict[str, Any], tmp_path: Path) -> list[Any]:
    """Figures of a table with these columns."""
    study = load_study({"scene": "two_link", "duration": 0.1, "vary": varied})
    metrics = tuple(name for name in columns if name not in varied)
    arrays = {name: np.array(values) for name, values in columns.items()}
    table = Table(arrays | {"run": np.arange(len(arrays[metrics[0]]))}, tuple(varied), metrics)
    with written() as figures:
        paths = draw(study, table, tmp_path)
    names = ["scatter.png", "distribution.png"][2 - len(figures) :]
    assert paths == [tmp_path / name for name in names]
    return figures


def test_figures_of_a_sweep_show_each_group_over_each_number(tmp_path: Path) -> None:
    damping = "joints.elbow.friction.viscous"
    scatter, distribution = drawn(
        {
            "controller": ["pd", "float", "pd", "float"],
            "gravity_scale": [1.0, 2.0, 3.0, 4.0],
            damping: [0.001, 0.01, 0.1, 1.0],
            "tracking_rms": [4.0, 1.0, 2.0, np.nan],
            "energy": [1.0, 10.0, 100.0, 1000.0],
            "saturated": [0.0, 0.0, 0.0, 0.0],  # nothing to see
        },
        {
            "controller": ["pd", "float"],
            "gravity_scale": {"uniform": [1.0, 4.0]},
            damping: {"log_uniform": [0.001, 1.0]},
        },
        tmp_path,
    )
    axes = np.reshape(scatter.axes, (2, 2))
    assert [axis.get_xlabel() for axis in axes[1]] == [
        "gravity scale", "elbow: friction, viscous\n[N m s/rad]"
    ]  # fmt: skip
    assert [axis.get_ylabel() for axis in axes[:, 0]] == [
        "RMS tracking error\n[rad]", "work of the drives\n[J]"
    ]  # fmt: skip
    assert [axis.get_yscale() for axis in axes[:, 0]] == ["linear", "log"]
    assert [axis.get_xscale() for axis in axes[0]] == ["linear", "log"]
    pd, float_ = (points.get_offsets() for points in axes[0, 1].collections)
    assert pd.tolist() == [[0.001, 4.0], [0.1, 2.0]] and float_[0].tolist() == [0.01, 1.0]
    assert [text.get_text() for text in scatter.legends[0].texts] == ["pd", "float"]
    first, second = distribution.axes
    assert first.get_ylabel() == "share of runs below" and second.get_xscale() == "log"
    pd, float_ = (line.get_xydata().tolist() for line in first.lines)
    assert pd == [[2.0, 0.5], [4.0, 1.0]] and float_ == [[1.0, 1.0]]
    assert [text.get_text() for text in distribution.legends[0].texts] == ["pd", "float"]


def test_without_a_number_there_is_no_scatter_and_without_a_metric_nothing(tmp_path: Path) -> None:
    words = {"controller": ["pd", "float"]}
    (only,) = drawn({**words, "energy": [1.0, 2.0]}, words, tmp_path)
    assert (
        only.axes[0].get_xlabel() == "work of the drives\n[J]"
        and only.axes[0].get_xscale() == "linear"
    )
    assert drawn({**words, "energy": [1.0, 1.0]}, words, tmp_path) == []
    numbers: dict[str, Any] = {"sim.dt": {"uniform": [0.001, 0.002]}}
    scatter, distribution = drawn(
        {"sim.dt": [0.001, 0.002], "energy": [1, 2.0]}, numbers, tmp_path
    )
    assert not scatter.legends and not distribution.legends
