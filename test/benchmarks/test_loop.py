# SPDX-License-Identifier: Apache-2.0
"""What the bare thread counts, with which the loop is compared."""

import numpy as np
import pytest

pytest.importorskip("arm_msgs")

from benchmarks.loop.baseline import lateness, spread


def test_the_bare_thread_counts_what_began_too_late() -> None:
    found = lateness(np.array([10_000, 10_300, 1_000_001, 5_000_000]))
    assert (found["ticks"], found["missed"]) == (4, 2)
    assert found["bars"] == [
        [pytest.approx(1e-6 * n), c] for n, c in ((11, 2), (1001, 1), (5001, 1))
    ]
    assert spread(np.array([1e6, 3e6]))["p50"] == pytest.approx(2e-3)
