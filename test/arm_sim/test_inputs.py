# SPDX-License-Identifier: Apache-2.0
"""Arguments are accepted up to their limits and refused beyond them, with the reason."""

import logging
from copy import copy
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, InvalidInput
from arm_sim.inputs import tick_count
from arm_sim.simulation.saturation import SaturationNotice

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("duration", "ticks"),
    [(0, 0), (0.0, 0), (0.3, 300), (np.float32(0.3), 300), (3 * 0.1, 300), (1e5, 10**8)],
)
def test_a_duration_is_a_number_of_ticks(
    duration: Any, ticks: int, caplog: pytest.LogCaptureFixture
) -> None:
    assert tick_count(duration, 1e-3) == ticks
    assert not caplog.text


@pytest.mark.parametrize(
    ("duration", "ticks", "told"),
    [(0.0006, 1, "0.001"), (0.0104, 10, "0.01"), (1.00037, 1000, "1"), (99.9999, 10**5, "100")],
)
def test_other_durations_are_rounded_with_a_warning(
    duration: float, ticks: int, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert tick_count(duration, 1e-3) == ticks
    (record,) = caplog.records
    text = f"duration = {duration} is no multiple of the time step of 0.001 s and is rounded to "
    assert record.getMessage() == f"{text}{told} s"


@pytest.mark.parametrize("duration", [1e-300, 1e-5, 0.0005])
def test_a_duration_of_less_than_a_tick_is_refused(duration: float) -> None:
    with pytest.raises(InvalidInput, match="less than the time step of 0.001 s; allowed: 0, or"):
        tick_count(duration, 1e-3)


def limited(*limits: float) -> ArmModel:
    """An arm of three joints with such limits of its commands."""
    model = copy(models.dynamics("planar_3r").model)
    vars(model)["command_limit"] = np.array(limits)
    return model


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]


@pytest.mark.parametrize(
    ("command", "effort", "words"),
    [
        ([1.0, 5.5, 0.0], [1.0, 5.0, 0.0], "5.5 N m of joint 'joint2' exceeds its limit of 5 "),
        (
            [[1, 1, 1], [1, 1, 8.5], [1, 1, 1]],
            [[1, 1, 1], [1, 1, 7], [1, 1, 1]],
            "8.5 N m of joint 'joint3' exceeds its limit of 7 ",
        ),
        (
            [[0, 6, 0], [0, -9, 0], [0, 8, 0]],
            [[0, 5, 0], [0, -5, 0], [0, 5, 0]],
            "-9 N m of joint 'joint2' exceeds its limit of 5 ",
        ),
    ],
)  # fmt: skip
def test_a_cut_is_told_once_with_the_joint_and_its_farthest_command(
    caplog: pytest.LogCaptureFixture, command: Any, effort: Any, words: str
) -> None:
    notice = SaturationNotice(limited(2.0, 5.0, 7.0))
    notice.check(np.array(command, float), np.array(effort, float))
    (text,) = said(caplog)
    assert text.startswith(f"command {words}")
    notice.check(np.array(command, float), np.array(effort, float))
    assert len(said(caplog)) == 1


def test_a_servo_at_its_limit_is_told_apart_from_commands(
    caplog: pytest.LogCaptureFixture,
) -> None:
    model = limited(2.0, 5.0, 7.0)
    notice, of_servos = SaturationNotice(model), SaturationNotice(model, "servo's command")
    for _ in range(2):
        of_servos.check(np.array([3.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
    assert not notice.logged
    notice.check(np.array([4.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
    words = "N m of joint 'joint1' exceeds its limit of 2 N m and is clipped to it; reported once"
    assert said(caplog) == [f"servo's command 3 {words}", f"command 4 {words}"]


def test_where_nothing_was_cut_nothing_is_said_and_the_first_cut_still_is(
    caplog: pytest.LogCaptureFixture,
) -> None:
    notice = SaturationNotice(limited(2.0, INF, INF))
    notice.check(np.array([2.0, 1e9, -1.0]), np.array([2.0, 1e9, -1.0]))
    notice.check(np.array([-0.0, 0.0, 1.0]), np.array([0.0, -0.0, 1.0]))
    notice.check(np.zeros((4, 3)), np.zeros((4, 3)))
    assert not said(caplog)
    notice.check(np.array([-2.5, 0.0, 0.0]), np.array([-2.0, 0.0, 0.0]))
    assert len(said(caplog)) == 1
