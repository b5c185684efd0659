# SPDX-License-Identifier: Apache-2.0
"""Curves of running arms that a page follows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import models
from arm_sim.view.follower import MEMORY, SAMPLED, Follower, News
from arm_sim.view.stage import DrawnArm

pytestmark = pytest.mark.group("view")


class Running:
    """An arm that stands still and has news whenever it is asked."""

    def __init__(self, step: float) -> None:
        self.time, self._step = 0.0, step

    def newest(self) -> News:
        self.time += self._step
        return News(self.time, *np.zeros((3, 2)))


def test_curves_go_back_by_the_seconds_that_they_promise(server: Any) -> None:
    model, arm = models.dynamics("two_link").model, Running(1.01 * SAMPLED)
    follower = Follower(server, [arm], [DrawnArm(server, model, "arm")])
    while arm.time < 1.2 * MEMORY:
        follower._beat(SAMPLED)
    for chart in follower._curves():
        assert np.ptp(chart.time) == pytest.approx(MEMORY, rel=0.02)
        assert chart.time[-1] == pytest.approx(arm.time, abs=2 * SAMPLED)
