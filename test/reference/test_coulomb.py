# SPDX-License-Identifier: Apache-2.0
"""Dry friction against closed forms: where a wheel comes to rest, where a mass on a spring turns
and stays.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arm_sim import Simulator, State
from tolerances import TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "coulomb.json").read_text())
STOP = {name: float(x) for name, x in DATA["coast_down"].items()}
HALF = float(DATA["oscillator"]["half_period"])
TURNS = np.array([float(x) for x in DATA["oscillator"]["turning_points"]])
OPTIONS: list[dict[str, Any]] = [{"integrator": "rk4"}, {"tolerance": 1e-9}]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_wheel_coasts_to_rest(options: dict[str, Any]) -> None:
    run = Simulator(HERE / "wheel.yaml", dt=1e-3, **options).run(1.0)
    assert_close(run.q[-1], [STOP["angle"]], TRAJECTORY)
    still = run.time >= STOP["time"]
    assert (run.v[~still] > 0.0).all() and not run.v[still].any()


def test_mass_on_a_spring_turns_where_it_should() -> None:
    """A torque is held for a tick, so the spring is given the mass's place in its middle."""
    h = HALF / 300
    sim = Simulator(HERE / "slider.yaml", integrator="rk4", dt=h)

    def spring(state: State) -> np.ndarray:
        return -100.0 * (state.q + 0.5 * h * state.v)

    run = sim.run(5 * HALF, spring)
    assert_close(run.q[[300, 600, 900], 0], TURNS, TRAJECTORY)
    moving = np.sign(run.v[run.v != 0.0])
    assert np.count_nonzero(np.diff(moving)) == len(TURNS) - 1
    assert not run.v[900:].any() and len(np.unique(run.q[900:])) == 1  # friction holds it there
