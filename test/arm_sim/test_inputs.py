# SPDX-License-Identifier: Apache-2.0
"""Durations in time steps, and what is said of commands that are cut."""

import logging
import re
from copy import copy
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim.inputs import tick_count
from arm_sim.simulation.saturation import SaturationNotice


@pytest.mark.parametrize(
    ("duration", "ticks", "told"),
    [
        (0, 0, ""), (np.float32(0.3), 300, ""), (3 * 0.1, 300, ""), (1e5, 10**8, ""),
        (0.0006, 1, "0.0006 .* to 0.001 s"), (1.00037, 1000, "1.00037 .* to 1 s"),
        (99.9999, 10**5, "99.9999 .* to 100 s"),
    ],
)  # fmt: skip
def test_a_duration_is_a_number_of_ticks_rounded_with_a_warning(
    duration: Any, ticks: int, told: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert tick_count(duration, 1e-3) == ticks
    assert re.search(told, caplog.text) and bool(told) == len(caplog.records)


@pytest.mark.parametrize("duration", [1e-300, 0.0005])
def test_a_duration_of_less_than_a_tick_is_refused(duration: float) -> None:
    with pytest.raises(InvalidInput, match="less than the time step of 0.001 s; allowed: 0, or"):
        tick_count(duration, 1e-3)


@pytest.mark.parametrize(
    ("command", "effort", "words"),
    [
        ([1.0, 5.5, 0.0], [1.0, 5.0, 0.0], "command 5.5 N m of joint 'joint2' exceeds"),
        (
            [[1, 1, 1], [1, 1, 8.5], [1, 1, 1]], [[1, 1, 1], [1, 1, 7], [1, 1, 1]],
            "command 8.5 N m of joint 'joint3' exceeds its limit of 7 ",
        ),
        (
            [[0, 6, 0], [0, -9, 0], [0, 8, 0]], [[0, 5, 0], [0, -5, 0], [0, 5, 0]],
            "command -9 N m of joint 'joint2' exceeds its limit of 5 ",
        ),
    ],
)  # fmt: skip
def test_a_cut_is_told_once_with_the_joint_and_its_farthest_command(
    caplog: pytest.LogCaptureFixture, command: Any, effort: Any, words: str
) -> None:
    model = copy(models.dynamics("planar_3r").model)
    vars(model)["command_limit"] = np.array([2.0, 5.0, 7.0])
    notice, of_servos = SaturationNotice(model), SaturationNotice(model, "servo's command")
    with caplog.at_level(logging.WARNING):
        notice.check(np.array([2.0, -0.0, 1.0]), np.array([2.0, 0.0, 1.0]))
        assert not caplog.messages
        for _ in range(2):
            of_servos.check(np.array([3.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
            notice.check(np.array(command, float), np.array(effort, float))
    of_servo, of_command = caplog.messages
    assert of_servo.startswith("servo's command 3 N m of joint 'joint1' exceeds its limit of 2 N")
    assert of_command.startswith(words)
