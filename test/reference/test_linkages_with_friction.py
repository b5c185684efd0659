# SPDX-License-Identifier: Apache-2.0
"""Closed chains with dry friction, thrown or driven by a motor, against their one coordinate."""

import json
from pathlib import Path
from typing import Any

import numpy as np

import models
from arm_sim import Simulator
from tolerances import assert_close

DATA: dict[str, dict[str, Any]] = json.loads(
    Path(__file__).with_name("linkages_with_friction.json").read_text()
)
TICKS = np.rint(np.array(DATA["four_bar"]["time"]) * 1000).astype(int)


def test_a_four_bar_goes_round_swings_and_stops_as_one_coordinate_does() -> None:
    """A four-bar with Coulomb friction in every hinge; where it stopped it stays to the bit."""
    data, given = DATA["four_bar"], models.scene("four_bar")
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
    assert_close(run.q[TICKS, 0], DATA["four_bar"]["theta"], 1e-9)
    assert abs(run.balance).max() < 1e-8 * run.lost[-1]
    stopped = np.flatnonzero((run.v == 0.0).all(axis=1))[0]
    assert 1.0 < run.time[stopped] < 9.0
    assert (run.q[stopped:] == run.q[stopped]).all() and not run.v[stopped:].any()


def test_a_motor_drives_a_slider_crank_that_rubs_on_its_rail() -> None:
    """The crank's angle over ten seconds, and what the pin bears along the rail."""
    data = DATA["slider_crank"]
    sim = Simulator(models.scene("slider_crank_motor"), dt=1e-3)
    sim.reset(data["q"], data["v"])
    run = sim.run(10.0, [data["voltage"], 0.0, 0.0])
    assert run.q[-1, 0] > 4 * np.pi
    assert_close(run.q[TICKS, 0], data["theta"], 1e-9)
    assert_close(run.multipliers[TICKS, 0], data["pin"], 1e-8)
    assert_close(run.balance / run.lost[-1], np.zeros(len(run)), 1e-8)
