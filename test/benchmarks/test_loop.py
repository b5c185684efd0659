# SPDX-License-Identifier: Apache-2.0
"""The report of the loop for given figures, and the bare thread."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("arm_msgs")

from arm_dynamics.codegen.compiler import find_compiler
from benchmarks.loop.baseline import lateness, spread, thread
from benchmarks.loop.page import promises, write

GOOD: dict[str, Any] = {
    "loop": {
        "seconds": 10.0, "priority": 0,
        "share": {"sim": 0.1, "controller": 0.12, "dynamics": 0.001},
        "thread": {"rate": 1000.0, "missed": 3, "p50": 5e-5, "p99": 1e-4, "max": 2e-3,
                   "share": 0.03, "bars": [(5e-5, 9990), (2e-3, 10)]},
        "loop": {"ticks": 10_000, "elapsed": 10.0, "missed": 6,
                 "lateness": {"p50": 5e-5, "p99": 2e-4, "max": 3e-3},
                 "bars": [(5e-5, 9990), (3e-3, 10)]},
        "round_trip": {"p50": 3e-4, "p99": 5e-4, "max": 2e-3},
    },
    "timer": {"rate": 800.0, "missed": 900, "share": 0.5},
    "ping": {"p50": 1.8e-3, "p99": 3e-3, "max": 1e-2},
    "services": {"p50": 4e-4, "p99": 1e-3, "max": 2e-3,
                 "bare": {"p50": 9e-4, "p99": 2e-3, "max": 3e-3},
                 "batches": {"inverse": {"10000": 5e5, "100000": 4e5},
                             "forward": {"10000": 5e5, "100000": 3e5}, "terms": {"10000": 1e5}}},
    "core": {"inverse": 2e6, "forward": 2e6, "terms": 2e6},
    "lockstep": {"ticks": 10, "compiled ticks": 10,
                 "across": [{"rate": 2500.0, "digest": "a"}] * 2,
                 "alone": [{"rate": 9000.0, "digest": "a"}] * 2,
                 "compiled": [{"rate": 1e5, "digest": "b"}] * 2},
    "load": [0.5, 1.5],
}  # fmt: skip


def test_the_loop_s_report_is_written(tmp_path: Path) -> None:
    text = write(copy.deepcopy(GOOD), tmp_path).read_text()
    assert "1000.000 Hz" in text
    assert "**no**" not in text
    assert (tmp_path / "figures/loop.png").stat().st_size > 1000
    worse = copy.deepcopy(GOOD)
    worse["loop"]["loop"]["missed"] = 7
    worse["services"]["bare"]["p50"] = 7e-4
    worse["core"]["inverse"] = 4e5
    worse["lockstep"]["across"] = [{"rate": 1999.0, "digest": letter} for letter in "ac"]
    assert [holds for *_, holds in promises(worse)].count(False) == 5


def test_the_bare_thread_counts_what_began_too_late() -> None:
    found = lateness(np.array([10_000, 10_300, 1_000_001, 5_000_000]))
    assert (found["ticks"], found["missed"]) == (4, 2)
    assert found["bars"] == [
        [pytest.approx(1e-6 * n), c] for n, c in ((11, 2), (1001, 1), (5001, 1))
    ]
    assert spread(np.array([1e6, 3e6]))["p50"] == pytest.approx(2e-3)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
def test_the_bare_thread_begins_no_tick_early() -> None:
    found = thread(0.05, 500_000)
    assert found["ticks"] == 100
    assert 0.0 <= found["p50"] <= found["p99"] <= found["max"]
