# SPDX-License-Identifier: Apache-2.0
"""The paired comparison times what its lines state, and reports what has become slower."""

import json
from io import StringIO
from pathlib import Path

from rich.console import Console

from benchmarks.regression.lines import lines
from benchmarks.regression.paired import ROOT, pair, table
from benchmarks.reporting.progress import Bar

LINES = lines()


def test_two_processes_measure_by_turns(tmp_path: Path) -> None:
    task = {"batch": {"kind": "inverse", "scene": LINES["four-bar"]["scene"], "points": 10},
            "wrong": {"kind": "run", "scene": {"robot": {"urdf": "<robot/>"}}}}  # fmt: skip
    path = tmp_path / "lines.json"
    path.write_text(json.dumps(task))
    with Bar(Console(file=StringIO())) as bar:
        found = pair((ROOT, ROOT), tmp_path, path, list(task), 2, bar)
    assert all(1e-9 < seconds < 1e-2 for seconds in found["batch"])
    assert str(found["wrong"]).startswith("this tree: ")


def test_only_what_is_slower_by_more_than_allowed_is_reported() -> None:
    ratios = {
        "slow": (1.06, 1.07, 1.08, 1.06, 1.09, 1.06),
        "noisy": (2.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        "well": (1.0, 1.04, 1.04, 1.0, 1.01, 1.03),
    }
    rounds = [{name: [r[k], 1.0] for name, r in ratios.items()} | {"gone": "no"} for k in range(6)]
    shown, failed, undecided = table(rounds, "older")
    assert failed == ["slow", "gone"]
    assert undecided == ["noisy"]
    assert shown.row_count == 4
