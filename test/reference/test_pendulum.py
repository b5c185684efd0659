# SPDX-License-Identifier: Apache-2.0
"""The plane pendulum against its closed form in Jacobi's elliptic functions."""

import json
from pathlib import Path

import numpy as np
import pytest

import models
from tolerances import TRAJECTORY, assert_close

DATA = json.loads(Path(__file__).with_name("pendulum.json").read_text())


def place(q: np.ndarray) -> np.ndarray:
    return np.array([np.sin(q[0]), -np.cos(q[0])])


def expected(t: int) -> np.ndarray:
    return np.array([float(x) for x in DATA["position"][str(t)]])


@pytest.mark.parametrize("t", [1, 2, 5, 10, 100])
def test_rk4_at_1_ms(t: int) -> None:
    run = models.simulator("pendulum", integrator="rk4", dt=1e-3).run(t)
    assert_close(place(run.q[-1]), expected(t), TRAJECTORY)


def test_rk4_at_1_ms_for_2000_s() -> None:
    sim = models.simulator("pendulum", integrator="rk4", dt=1e-3)
    for _ in range(20):
        sim.run(100.0)
    assert sim.state.time == 2000.0
    assert_close(place(sim.state.q), expected(2000), TRAJECTORY)


def test_period() -> None:
    """Back at the start after one period, to the tick: the angle falls short by g h²/2 at most."""
    period, h = float(DATA["period"]), 1e-3
    run = models.simulator("pendulum", integrator="rk4", dt=h).run(1.5 * period)
    later = run.time > 0.75 * period
    peak = run.time[later][np.argmax(run.q[later, 0])]
    assert abs(peak - period) <= h


def test_small_swings_are_slower_the_wider_they_are() -> None:
    """Period over 2 pi sqrt(l/g) is 1 + a²/16 + 11 a⁴/3072 + 173 a⁶/737280 (Nelson and Olsson, Am.
    J. Phys. 54, 1986).
    """
    sim = models.simulator("pendulum", integrator="rk4", dt=1e-3)
    for angle in (0.05, 0.2, 0.5):
        sim.reset(q=[angle], v=[0.0])
        run = sim.run(12.0)
        down = np.flatnonzero((run.q[:-1, 0] > 0) & (run.q[1:, 0] <= 0))
        crossings = run.time[down] + 1e-3 * run.q[down, 0] / (run.q[down, 0] - run.q[down + 1, 0])
        ratio = np.diff(crossings).mean() * np.sqrt(9.81) / (2 * np.pi)
        series = 1 + angle**2 / 16 + 11 * angle**4 / 3072 + 173 * angle**6 / 737280
        assert_close(ratio, series, TRAJECTORY)
