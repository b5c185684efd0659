# SPDX-License-Identifier: Apache-2.0
"""How long a pendulum takes, from a swing of 1° to one of 179°, against the elliptic integral."""

import numpy as np
import pytest
from scipy.special import ellipkm1

import models
from arm_sim import Simulator
from tolerances import TRAJECTORY, assert_close


@pytest.mark.parametrize("degrees", [1, 10, 30, 60, 90, 120, 150, 170, 179])
def test_ratio_to_small_swings(degrees: int) -> None:
    """2 K(sin²(a/2))/π (Landau and Lifshitz, Mechanics, §11), by ticks that divide a quarter.

    After two quarters it turns on the other side; after five it passes its lowest point.
    """
    swing = np.deg2rad(degrees)
    wanted = 2.0 * ellipkm1(np.cos(swing / 2) ** 2) / np.pi
    quarter = wanted * 2 * np.pi / np.sqrt(9.81) / 4
    ticks = round(quarter / 1e-3)
    sim = Simulator(models.scene("pendulum"), integrator="rk4", dt=quarter / ticks)
    sim.reset(q=[swing], v=[0.0])
    run = sim.run(5 * quarter)
    assert_close([run.q[2 * ticks, 0], run.v[2 * ticks, 0]], [-swing, 0.0], TRAJECTORY)
    assert run.q[2 * ticks, 0] == run.q[: 2 * ticks + 1].min()
    assert run.v[-1, 0] < 0.0, "a fifth quarter ends on the way down"
    late = run.q[-1, 0] / -run.v[-1, 0]
    assert_close(wanted * (1 + late / (5 * quarter)), wanted, TRAJECTORY)
