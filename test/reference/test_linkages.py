# SPDX-License-Identifier: Apache-2.0
"""Closed chains with multipliers against the same linkages in their one coordinate: slider-crank
and four-bar to 20 digits with their joint forces, or with dry friction and a motor; rows of
parallelograms in closed form.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, load_scene
from arm_sim import Simulator
from tolerances import ALGEBRA, MULTIPLIER, TRAJECTORY, assert_close

HERE = Path(__file__).parent
DATA = json.loads((HERE / "linkages.json").read_text())
ROWS = json.loads((HERE / "four_bar.json").read_text())
RUBBING = json.loads((HERE / "linkages_with_friction.json").read_text())
TICKS = np.rint(np.array(RUBBING["four_bar"]["time"]) * 1000).astype(int)
TORQUE = {"slider_crank": [0.5, 0.0, 0.0], "four_bar": [0.0, 0.0, 0.0]}
CHANGED = {
    "slider_crank": {"joints": {"pivot": {"friction": {"viscous": 0.05}}}},
    "four_bar": {"gravity": [0, 0, -1.62]},
}


@cache
def scene(name: str) -> Any:
    plain = load_scene(models.SCENES / f"{name}.yaml").model_dump(exclude_unset=True)
    return load_scene(plain | CHANGED[name])


def numbers(name: str, t: str, what: str) -> np.ndarray:
    return np.array([float(x) for x in DATA[name][t][what]])


@pytest.mark.parametrize("name", TORQUE)
def test_motion_and_joint_force_at_1_ms(name: str) -> None:
    """λ is what the first frame exerts upon the second, found there by Newton and Euler."""
    sim = Simulator(scene(name), integrator="rk4", dt=1e-3)
    sim.reset(numbers(name, "0", "q"), numbers(name, "0", "v"))
    run, dyn = sim.run(10.0, TORQUE[name]), Dynamics(scene(name))
    for t in DATA[name]:
        q, v, force = (numbers(name, t, what) for what in ("q", "v", "force"))
        k = 1000 * int(t)
        np.testing.assert_allclose(run.q[k], q, rtol=0.0, atol=TRAJECTORY)
        np.testing.assert_allclose(run.v[k], v, rtol=0.0, atol=10 * TRAJECTORY)
        _, lam = dyn.constrained_forward(q, v, TORQUE[name])
        np.testing.assert_allclose(lam, force, rtol=0.0, atol=MULTIPLIER)
    assert_close(run.multipliers[-1], force, 100 * TRAJECTORY)
    assert_close(run.multipliers[-1], sim.multipliers(), ALGEBRA)


@pytest.mark.parametrize("N", ["1", "2"])
def test_parallelograms_go_through_flat(N: str) -> None:
    """Twenty times through the position in which they might as well cross."""
    sim = Simulator(HERE / f"parallelograms_{N}.yaml", integrator="rk4", dt=1e-3)
    run = sim.run(20.0)
    cranks = [i for i, name in enumerate(sim.joint_names) if name.startswith("pivot")]
    for t, state in ROWS[N].items():
        th, rate = (float(x) for x in state[:2])
        np.testing.assert_allclose(run.q[1000 * int(t), cranks], th, rtol=0.0, atol=TRAJECTORY)
        np.testing.assert_allclose(run.v[1000 * int(t), cranks], rate, rtol=0.0, atol=TRAJECTORY)


def test_a_four_bar_goes_round_swings_and_stops_as_one_coordinate_does() -> None:
    """A four-bar with Coulomb friction in every hinge; where it stopped it stays to the bit."""
    data, given = RUBBING["four_bar"], models.scene("four_bar")
    names = ("crank_pivot", "knee", "rocker_pivot")
    hinges = {
        name: {"friction": {"coulomb": level}}
        for name, level in zip(names, data["coulomb"], strict=True)
    }
    start = {"position": dict(zip(names, data["q"], strict=True))}
    scene = given.model_dump(mode="json", exclude_none=True)
    sim = Simulator(scene | {"joints": hinges, "initial": start}, integrator="dop853", dt=1e-3)
    sim.reset(data["q"], data["v"])
    run = sim.run(10.0)
    assert np.ptp(run.q[:, 0]) > 2 * np.pi
    assert_close(run.q[TICKS, 0], data["theta"], 1e-9)
    assert abs(run.balance).max() < 1e-8 * run.lost[-1]
    stopped = np.flatnonzero((run.v == 0.0).all(axis=1))[0]
    assert 1.0 < run.time[stopped] < 9.0
    assert (run.q[stopped:] == run.q[stopped]).all() and not run.v[stopped:].any()


def test_a_motor_drives_a_slider_crank_that_rubs_on_its_rail() -> None:
    """The crank's angle over ten seconds, and what the pin bears along the rail."""
    data = RUBBING["slider_crank"]
    sim = Simulator(models.scene("slider_crank_motor"), dt=1e-3)
    sim.reset(data["q"], data["v"])
    run = sim.run(10.0, [data["voltage"], 0.0, 0.0])
    assert run.q[-1, 0] > 4 * np.pi
    assert_close(run.q[TICKS, 0], data["theta"], 1e-9)
    assert_close(run.multipliers[TICKS, 0], data["pin"], 1e-8)
    assert_close(run.balance / run.lost[-1], np.zeros(len(run)), 1e-8)
