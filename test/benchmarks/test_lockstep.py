# SPDX-License-Identifier: Apache-2.0
"""Lockstep as the benchmark of the loop measures it: repeated runs are identical to the bit."""

from pathlib import Path

import pytest

from benchmarks.loop.lockstep import lockstep
from support.harness import reserve_domain

pytestmark = pytest.mark.ros
TICKS = 400  # the motion begins after half of them


def test_runs_across_processes_and_in_one_are_identical(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    domain, reservation = reserve_domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))  # of the controller's process
    with reservation:
        found = lockstep("two_link", TICKS, TICKS, tmp_path, domain)
    assert len({run["digest"] for run in [*found["across"], *found["alone"]]}) == 1
    assert len({run["digest"] for run in found["compiled"]}) == 1
