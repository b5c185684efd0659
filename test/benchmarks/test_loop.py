# SPDX-License-Identifier: Apache-2.0
"""The report of the loop for given figures, and the bare thread."""

import numpy as np
import pytest

pytest.importorskip("arm_msgs")

from arm_dynamics.codegen.compiler import find_compiler
from benchmarks.loop.baseline import lateness, spread, thread


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
