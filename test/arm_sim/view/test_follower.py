# SPDX-License-Identifier: Apache-2.0
"""Curves of running arms that a page follows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import models
from arm_sim.view.follower import Follower, News
from arm_sim.view.marks import Instant
from arm_sim.view.stage import DrawnArm

pytestmark = pytest.mark.group("view")


class Telling:
    """An arm whose news are given one by one."""

    def __init__(self) -> None:
        self.news: News | None = None

    def newest(self) -> News | None:
        news, self.news = self.news, None
        return news


def test_curves_and_times_are_those_of_each_arm(
    server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.view.follower.CHARTED", 0.0)
    model = models.dynamics("two_link").model
    arms = [Telling(), Telling()]
    actors = [DrawnArm(server, model, name) for name in ("left", "right")]
    follower = Follower(server, arms, actors)
    assert follower._status.content == "waiting"
    effort, error, energy = np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.arange(5.0)
    for time in (100.0, 100.5):
        arms[0].news = News(time, np.array([0.1, 0.2]), effort * time, error * time, energy * time)
        follower._beat(0.1)
    torque, off, account, *others = follower._curves()
    assert [chart.title for chart in (torque, off, account)] == [
        "left: torque [N m]", "left: error [rad]", "left: energy [J]"
    ]  # fmt: skip
    np.testing.assert_array_equal(torque.time, [0.0, 0.5])  # since the first news
    for chart, values in ((torque, effort), (off, error), (account, energy)):
        np.testing.assert_array_equal(chart.values, np.outer([100.0, 100.5], values))
    assert not any(len(chart.time) for chart in others)
    assert follower._status.content == "left: t = 0.50 s\n\nright: t = 0.00 s, no data yet"
    expected = actors[0].marker.at(Instant(0.0, np.array([0.1, 0.2])))
    for frame, place in zip(actors[0]._joints, expected.position, strict=True):
        np.testing.assert_array_equal(frame.position, place)


def test_curves_begin_anew_with_a_run_and_silence_is_told(
    server: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_sim.view.follower.CHARTED", 0.0)
    model, arm = models.dynamics("two_link").model, Telling()
    follower = Follower(server, [arm], [DrawnArm(server, model, "arm")])
    for time in (5.0, 6.0, 7.0, 6.5):
        arm.news = News(time, *np.zeros((3, 2)))
        follower._beat(0.1)
    np.testing.assert_array_equal(follower._curves()[0].time, [1.5])
    monkeypatch.setattr("arm_sim.view.follower.OLD", -1.0)
    follower._beat(0.1)
    assert follower._status.content == "arm: t = 1.50 s, silent for 0 s"
    follower._show_status("no luck")
    assert follower._status.content.endswith("\n\n**no luck**")
