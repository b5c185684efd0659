# SPDX-License-Identifier: Apache-2.0
"""How long a pendulum takes, from a swing of 1° to one of 179°, against the elliptic integral."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import models
from arm_sim import Simulator
from tolerances import TRAJECTORY, assert_close

DATA = json.loads(Path(__file__).with_name("pendulum_periods.json").read_text())["ratio"]


@pytest.mark.parametrize("degrees", DATA)
def test_ratio_to_small_swings(degrees: str) -> None:
    """Ticks of about 1 ms that divide a quarter of the period: there the mass must pass its lowest
    point, and the ratio is off by what it still lacks.
    """
    swing, wanted = np.deg2rad(float(degrees)), float(DATA[degrees])
    quarter = wanted * 2 * np.pi / np.sqrt(9.81) / 4
    ticks = round(quarter / 1e-3)
    sim = Simulator(models.scene("pendulum"), integrator="rk4", dt=quarter / ticks)
    sim.reset(q=[swing], v=[0.0])
    run = sim.run(5 * quarter)
    assert run.v[-1, 0] < 0.0, "a fifth quarter ends on the way down"
    late = run.q[-1, 0] / -run.v[-1, 0]
    assert_close(wanted * (1 + late / (5 * quarter)), wanted, TRAJECTORY)


@pytest.mark.parametrize("degrees", DATA)
def test_turns_on_the_other_side_after_half_a_period(degrees: str) -> None:
    swing = np.deg2rad(float(degrees))
    half = float(DATA[degrees]) * np.pi / np.sqrt(9.81)
    sim = Simulator(models.scene("pendulum"), integrator="rk4", dt=half / round(half / 1e-3))
    sim.reset(q=[swing], v=[0.0])
    run = sim.run(half)
    assert_close([run.q[-1, 0], run.v[-1, 0]], [-swing, 0.0], TRAJECTORY)
    assert run.q[-1, 0] == run.q.min()
