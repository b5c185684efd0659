# SPDX-License-Identifier: Apache-2.0
"""Arguments are accepted up to their limits and refused beyond them, with the reason."""

from __future__ import annotations

import logging
from copy import copy
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import ArmModel, InvalidInput
from arm_sim.inputs import SaturationNotice, row, tick_count, torque, torque_table, whole

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    "given", [[1.0, 2.5], (1, 2.5), np.array([1.0, 2.5]), np.array([1.0, 2.5], np.float32)]
)
def test_a_torque_becomes_plain_numbers(given: Any) -> None:
    numbers = torque(given, 2)
    assert numbers == [1.0, 2.5]
    assert all(type(x) is float for x in numbers)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([1.0], r"tau has shape \(1,\); expected \(2,\)"),
        ([1.0, 2.0, 3.0], r"tau has shape \(3,\); expected \(2,\)"),
        (1.0, r"tau has shape \(\); expected \(2,\)"),
        ([[1.0, 2.0]], r"tau has shape \(1, 2\); expected \(2,\)"),
        (np.zeros((2, 1)), r"tau has shape \(2, 1\); expected \(2,\)"),
        ([NAN, 0.0], r"tau\[0\] = nan"),
        (np.array([0.0, INF]), r"tau\[1\] = inf"),
        (np.array([0.0, -INF]), r"tau\[1\] = -inf"),
        (["a", "b"], "tau"),
        (None, "tau"),
        (np.array([1, 2j]), "tau"),
    ],
)
def test_anything_else_is_no_torque(given: Any, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        torque(given, 2)


def test_torques_of_a_run_are_zero_held_or_a_row_for_each_tick() -> None:
    np.testing.assert_array_equal(torque_table(None, 3, 2, 1e-3), [0.0, 0.0])
    np.testing.assert_array_equal(torque_table([1, 2], 3, 2, 1e-3), [1.0, 2.0])
    rows = np.arange(6.0).reshape(3, 2)
    np.testing.assert_array_equal(torque_table(rows, 3, 2, 1e-3), rows)
    np.testing.assert_array_equal(torque_table([[1, 2]], 1, 2, 1e-3), [[1.0, 2.0]])


def test_torques_of_a_run_lie_in_one_piece() -> None:
    table = torque_table(np.arange(6.0).reshape(2, 3).T, 3, 2, 1e-3)
    np.testing.assert_array_equal(table, [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]])
    assert table.flags.c_contiguous


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (np.zeros((2, 2)), "control has 2 rows; the run has 3 ticks of 0.001 s"),
        (np.zeros((4, 2)), "control has 4 rows; the run has 3 ticks of 0.001 s"),
        (np.zeros(3), "control has shape"),
        (np.zeros((3, 3)), "control has shape"),
        (np.zeros((1, 3, 2)), "control has shape"),
        ([[0, 0], [0, NAN], [0, 0]], r"control\[1, 1\] = nan"),
    ],
)
def test_other_tables_are_refused(given: Any, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        torque_table(given, 3, 2, 1e-3)


@pytest.mark.parametrize(("given", "n"), [([], 0), (np.zeros(0), 0), ([1.5], 1), ([1, 2], 2)])
def test_a_row_may_be_empty_only_where_nothing_is_expected(given: Any, n: int) -> None:
    taken = row("q", given, n)
    np.testing.assert_array_equal(taken, given)
    assert taken.shape == (n,)
    assert taken.dtype == float


@pytest.mark.parametrize(
    ("given", "n", "said"),
    [
        ([], 2, "q has shape"),
        ([1.0], 0, "q has shape"),
        (1.0, 1, "q has shape"),
        ([1.0, 2.0], 1, "q has shape"),
        ([1.0], 2, "q has shape"),
        ([[1.0, 2.0]], 2, r"q has shape \(1, 2\); expected \(2,\)"),
        ([[1.0], [2.0]], 1, r"q has shape \(2, 1\); expected \(1,\)"),
        ([1.0, NAN], 2, r"q\[1\] = nan"),
    ],
)
def test_other_rows_are_refused(given: Any, n: int, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        row("q", given, n)


@pytest.mark.parametrize("value", [3, 4, np.int64(3), np.uint8(200)])
def test_whole_numbers_from_the_least_one_on_are_taken(value: Any) -> None:
    whole("ticks", value, 3)


@pytest.mark.parametrize("value", [2, 0, -3, np.int32(2), 3.0, np.float64(4.0), "3", None, NAN])
def test_smaller_ones_and_other_things_are_refused(value: Any) -> None:
    with pytest.raises(InvalidInput, match="ticks = .*; expected a whole number of at least 3"):
        whole("ticks", value, 3)


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
    text = (
        f"duration = {duration} is no multiple of the tick of 0.001 s and is rounded to {told} s"
    )
    assert record.getMessage() == text


@pytest.mark.parametrize("duration", [1e-300, 1e-5, 0.0005])
def test_a_duration_of_less_than_a_tick_is_refused(duration: float) -> None:
    with pytest.raises(InvalidInput, match="less than the tick of 0.001 s; allowed: 0, or at lea"):
        tick_count(duration, 1e-3)


@pytest.mark.parametrize(
    "duration", [-1e-9, -1.0, -INF, INF, NAN, "long", "1e-2", None, [1.0, 2.0]]
)
def test_other_durations_are_refused(duration: Any) -> None:
    with pytest.raises(InvalidInput, match="duration = .*; expected a finite time of at least"):
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
        ([1.0, -5.5, 0.0], [1.0, -5.0, 0.0], "-5.5 N m of joint 'joint2' exceeds its limit of 5 "),
        ([3.0, 9.0, 0.0], [2.0, 5.0, 0.0], "3 N m of joint 'joint1' exceeds its limit of 2 "),
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
    notice.look(np.array(command, float), np.array(effort, float))
    (text,) = said(caplog)
    assert text.startswith(f"command {words}")
    notice.look(np.array(command, float), np.array(effort, float))
    assert len(said(caplog)) == 1


def test_a_servo_at_its_limit_is_told_apart_from_commands(
    caplog: pytest.LogCaptureFixture,
) -> None:
    notice = SaturationNotice(limited(2.0, 5.0, 7.0))
    for _ in range(2):
        notice.look(np.array([3.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]), servo=True)
    assert not notice.logged
    notice.look(np.array([4.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]))
    words = "N m of joint 'joint1' exceeds its limit of 2 N m and is clipped to it; reported once"
    assert said(caplog) == [f"servo's command 3 {words}", f"command 4 {words}"]


def test_where_nothing_was_cut_nothing_is_said_and_the_first_cut_still_is(
    caplog: pytest.LogCaptureFixture,
) -> None:
    notice = SaturationNotice(limited(2.0, INF, INF))
    notice.look(np.array([2.0, 1e9, -1.0]), np.array([2.0, 1e9, -1.0]))
    notice.look(np.array([-0.0, 0.0, 1.0]), np.array([0.0, -0.0, 1.0]))
    notice.look(np.zeros((4, 3)), np.zeros((4, 3)))
    assert not said(caplog)
    notice.look(np.array([-2.5, 0.0, 0.0]), np.array([-2.0, 0.0, 0.0]))
    assert len(said(caplog)) == 1


def test_an_arm_without_limits_never_reports_clipping(caplog: pytest.LogCaptureFixture) -> None:
    SaturationNotice(limited(INF, INF, INF)).look(np.ones(3), np.zeros(3))
    assert not said(caplog)
