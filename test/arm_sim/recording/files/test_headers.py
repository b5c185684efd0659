# SPDX-License-Identifier: Apache-2.0
"""Names of columns in tables of common loggers."""

import numpy as np
import pytest

from arm_sim.recording.files.headers import Column, read_header


@pytest.mark.parametrize(
    "names",
    [
        ("Time [s]", "hip_position", "hip_effort"),
        ("t", "q_hip [rad]", "tau_hip [Nm]"),
        ("timestamp", "pos_hip", "torque_hip"),
        ("__time", "/joint_states/hip/position", "/joint_states/hip/effort"),
    ],
)
def test_the_same_table_under_many_names(names):
    header = read_header(names)
    assert header.clock == Column(0)
    assert header.joints == ("hip",)
    assert header.columns == {("position", "hip"): Column(1), ("effort", "hip"): Column(2)}


def test_units_in_brackets_are_read():
    columns = ["time_ms", "hip.pos [deg]", "hip.vel (deg/s)", "slide_q [mm]", "hip.tau [turns]"]
    header = read_header(columns)
    assert header.clock == Column(0, 1e-3)
    factors = [column.factor for column in header.columns.values()]
    np.testing.assert_allclose(factors, [np.pi / 180.0, np.pi / 180.0, 1e-3])


@pytest.mark.parametrize("first", [0, 1])
def test_numbered_joints(first):
    header = read_header(["t", *(f"{what}{first + i}" for what in ("q", "tau") for i in range(3))])
    assert header.joints == ("joint1", "joint2", "joint3")
    assert header.columns["effort", "joint3"] == Column(6)


def test_names_that_hold_such_words_are_left_whole():
    header = read_header(["time", "position.left/q_elbow_pos", "effort.left/q_elbow_pos", "q_²"])
    assert header.joints == ("left/q_elbow_pos", "²")
