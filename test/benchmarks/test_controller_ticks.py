# SPDX-License-Identifier: Apache-2.0
"""The table of the controllers' ticks can be made: laws, nodes and what they publish."""

from __future__ import annotations

import os
import re

import pytest

from arm_dynamics.ros.common.transport import DISCOVERY
from benchmarks.latency import controller_ticks

pytestmark = pytest.mark.ros


def test_every_law_has_its_times(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ("computed_torque", "motion_force")
    monkeypatch.setenv(DISCOVERY, os.environ.get(DISCOVERY, ""))  # put back afterwards
    for name, value in {"NAMES": names, "CALLS": 3, "WARM_UP": 1}.items():
        monkeypatch.setattr(controller_ticks, name, value)
    controller_ticks.main()
    table = capsys.readouterr().out
    for name in (*names, r"computed_torque \+ observer"):
        row = re.search(rf"│ {name} +│(.*)│\n", table)
        assert row is not None
        times = [float(cell) for cell in row[1].split("│")]
        assert len(times) == 6
        for least, median in zip(times[::2], times[1::2], strict=True):
            assert 1.0 < least <= median
