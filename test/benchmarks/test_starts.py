# SPDX-License-Identifier: Apache-2.0
"""Nodes are started and killed, and no joint moves: one short round of the benchmark."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from benchmarks.loop import starts

pytestmark = pytest.mark.ros


@pytest.mark.nightly  # test/arm_sim/ros/test_robustness_processes.py kills the nodes of a loop
def test_no_joint_moves_when_nodes_start_and_are_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(starts, "WATCHED", 0.4)
    before = dict(os.environ)
    found = starts.trial("two_link", random.Random(4), True, tmp_path)
    assert dict(os.environ) == before
    assert sorted(found["kills"]) == sorted(starts.NODES)
    assert found["states"] > 100
    assert found["moved"] <= starts.ALLOWED
