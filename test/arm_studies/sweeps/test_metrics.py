# SPDX-License-Identifier: Apache-2.0
"""Metrics of motions whose numbers are known."""

import numpy as np
import pytest

from arm_studies.sweeps.metrics import RunRecord, evaluate

DT = 0.1


def run() -> RunRecord:
    """Two joints; the first goes from 0 to 1 and swings over to 1.2, the second stays."""
    q = np.array([[0.0, 3.0], [0.5, 3.0], [1.2, 3.0], [1.0, 3.0]])
    reference = np.array([[0.0, 3.0], [0.5, 3.0], [1.0, 3.0], [1.0, 3.0]])
    torque = np.array([[2.0, -5.0], [1.0, -5.0], [-3.0, -5.0]])
    stops = np.array([[-9.0, -np.inf], [1.2, np.inf]])
    return RunRecord(DT, q, reference, torque, torque, np.array([3.0, np.inf]), stops)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("tracking_rms", 0.2 / np.sqrt(8)),
        ("tracking_rms.first", 0.2 / 2),
        ("tracking_max", 0.2),
        ("tracking_max.second", 0.0),
        ("final_error", 0.0),
        ("overshoot", 0.2),
        ("overshoot.second", 0.0),
        ("energy", 2.0 * 0.5 + 1.0 * 0.7 + 3.0 * 0.2),
        ("torque_rms", np.sqrt((4 + 1 + 9 + 75) / 6)),
        ("torque_max", 5.0),
        ("saturation", 1 / 3),
        ("stop_time", DT),
    ],
)
def test_metrics(name: str, value: float) -> None:
    assert evaluate(run(), [name], ("first", "second")) == [pytest.approx(value, rel=1e-14)]


def test_all_joints_count_and_may_overshoot_downwards() -> None:
    """Both joints move and brake; the first runs over by 0.1 of its way down, the second ends
    farther off.
    """
    q = np.array([[1.0, 0.0], [-1.2, -1.0], [-1.0, -2.0]])
    reference = np.array([[1.9, 0.0], [0.0, -1.0], [-1.0, -1.7]])
    torque, none = np.array([[-2.0, 3.0], [4.0, -5.0]]), np.full(2, np.inf)
    made = RunRecord(DT, q, reference, torque, torque, none, np.array([-none, none]))
    names = ["overshoot.first", "final_error", "final_error.first", "energy.second", "saturation",
             "stop_time"]  # fmt: skip
    wanted = [0.2 / 2.9, 0.3, 0.0, 8.0, 0.0, 0.0]
    assert evaluate(made, names, ("first", "second")) == pytest.approx(wanted, rel=1e-12)
