# SPDX-License-Identifier: Apache-2.0
"""Closed chains with multipliers against the same linkages in their one coordinate: slider-crank
and four-bar to 20 digits with their joint forces, rows of parallelograms in closed form.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, load_scene
from arm_sim import Recording, Simulator
from tolerances import ALGEBRA, MULTIPLIER, TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "linkages.json").read_text())
ROWS = json.loads((HERE / "four_bar.json").read_text())
TORQUE = {"slider_crank": [0.5, 0.0, 0.0], "four_bar": [0.0, 0.0, 0.0]}
CHANGED = {
    "slider_crank": {"joints": {"pivot": {"friction": {"viscous": 0.05}}}},
    "four_bar": {"gravity": [0, 0, -1.62]},
}
TIMES = [(name, t) for name in TORQUE for t in DATA[name]]


@cache
def scene(name: str) -> Any:
    plain = load_scene(models.SCENES / f"{name}.yaml").model_dump(exclude_unset=True)
    return load_scene(plain | CHANGED[name])


def numbers(name: str, t: str, what: str) -> np.ndarray:
    return np.array([float(x) for x in DATA[name][t][what]])


@cache
def motion(name: str) -> tuple[Simulator, Recording]:
    sim = Simulator(scene(name), integrator="rk4", dt=1e-3)
    sim.reset(numbers(name, "0", "q"), numbers(name, "0", "v"))
    return sim, sim.run(10.0, TORQUE[name])


@pytest.mark.parametrize(("name", "t"), TIMES)
def test_rk4_at_1_ms(name: str, t: str) -> None:
    _, run = motion(name)
    k = 1000 * int(t)
    np.testing.assert_allclose(run.q[k], numbers(name, t, "q"), rtol=0.0, atol=TRAJECTORY)
    np.testing.assert_allclose(run.v[k], numbers(name, t, "v"), rtol=0.0, atol=10 * TRAJECTORY)


@pytest.mark.parametrize(("name", "t"), TIMES)
def test_multipliers_are_the_joint_force(name: str, t: str) -> None:
    """λ is what the first frame exerts upon the second, found there by Newton and Euler."""
    dyn = Dynamics(scene(name))
    _, lam = dyn.constrained_forward(numbers(name, t, "q"), numbers(name, t, "v"), TORQUE[name])
    np.testing.assert_allclose(lam, numbers(name, t, "force"), rtol=0.0, atol=MULTIPLIER)


@pytest.mark.parametrize("name", TORQUE)
def test_recorded_multipliers(name: str) -> None:
    sim, run = motion(name)
    assert_close(run.multipliers[-1], numbers(name, "10", "force"), 100 * TRAJECTORY)
    assert_close(run.multipliers[-1], sim.multipliers(), ALGEBRA)


@cache
def row_of_parallelograms(N: str) -> tuple[Simulator, Recording]:
    sim = Simulator(HERE / f"parallelograms_{N}.yaml", integrator="rk4", dt=1e-3)
    return sim, sim.run(20.0)


@pytest.mark.parametrize(("N", "t"), [(N, t) for N in ("1", "2") for t in ROWS[N]])
def test_parallelograms_go_through_flat(N: str, t: str) -> None:
    """Twenty times through the position in which they might as well cross."""
    sim, run = row_of_parallelograms(N)
    cranks = [i for i, name in enumerate(sim.joint_names) if name.startswith("pivot")]
    th, rate = (float(x) for x in ROWS[N][t])
    k = 1000 * int(t)
    np.testing.assert_allclose(run.q[k, cranks], th, rtol=0.0, atol=TRAJECTORY)
    np.testing.assert_allclose(run.v[k, cranks], rate, rtol=0.0, atol=TRAJECTORY)
