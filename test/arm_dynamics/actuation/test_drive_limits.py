# SPDX-License-Identifier: Apache-2.0
"""Limits of a motor that meet: which one holds, for every kind of command and every speed."""

from typing import Any

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_dynamics.equations.motor import back_emf
from models.driven import law, of_states, wheel
from tolerances import ALGEBRA, assert_close

R, K, N, MOST, V = 0.8, 0.05, 10.0, 3.0, 6.0
WINDING: dict[str, Any] = {"resistance": R, "torque_constant": K, "gear_ratio": N}
OVERSPEED = (V + R * MOST) / (K * N)


def current(command: str, speed: float, asked: float, **limits: float) -> float:
    """Current in [A] of a motor without inductance at a speed of the joint."""
    drives = law(wheel(0.02, **WINDING, command=command, **limits))
    return float(of_states(drives, 1)["torque"](0.0, speed, np.zeros(0), asked)) / (K * N)


@pytest.mark.parametrize("speed", np.linspace(-3.0, 3.0, 13) * V / (K * N))
@pytest.mark.parametrize(("command", "asked"), [
    ("torque", 0.0), ("torque", 100.0), ("current", 0.0), ("current", -100.0),
    ("voltage", V), ("voltage", -V),
])  # fmt: skip
def test_the_current_limit_holds_at_any_speed(command: str, asked: float, speed: float) -> None:
    """And the voltage limit up to the speed from which both contradict each other."""
    limits = {"current_limit": MOST} | ({} if command == "voltage" else {"voltage_limit": V})
    i = current(command, speed, asked, **limits)
    assert abs(i) <= MOST * (1.0 + 1e-12)
    if abs(speed) <= OVERSPEED:
        assert abs(R * i + back_emf(N * speed, K)) <= V * (1.0 + 1e-12) or command == "voltage"
    else:
        assert_close(i, -np.sign(speed) * MOST, ALGEBRA)  # it brakes as hard as it may


@pytest.mark.parametrize("speed", [-20.0, -5.0, 0.0, 5.0, 20.0])
def test_the_voltage_limit_alone_lets_a_motor_brake_harder(speed: float) -> None:
    i = current("torque", speed, 0.0, voltage_limit=V)
    low, high = ((way * V - K * N * speed) / R for way in (-1.0, 1.0))
    assert_close(i, min(max(0.0, low), high), ALGEBRA)


def test_the_speed_at_which_both_contradict_each_other() -> None:
    (both,) = ArmModel(
        load_scene(wheel(0.02, **WINDING, current_limit=MOST, voltage_limit=V))
    ).drives
    (one,) = ArmModel(load_scene(wheel(0.02, **WINDING, current_limit=MOST))).drives
    assert both and one
    assert_close(both.overspeed, OVERSPEED, ALGEBRA)
    assert one.overspeed == np.inf
