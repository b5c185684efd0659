# SPDX-License-Identifier: Apache-2.0
"""Every pair of features in one scene, and many at once, against independent solutions."""

import json
from functools import cache
from typing import Any

import numpy as np
import pytest

from arm_sim import Simulator
from arm_sim.simulation.runtime_changes import payload_change
from models import features
from reference import make_features_together as solutions
from support.samples import sampled

TOLERANCE = 1e-11  # of error control
POSITION = 1e-7  # [rad] that a position may be off
ACCOUNT = 1e-8  # part of the energy that moved that may be missing
DT = 1e-3  # [s]
QUICK = tuple(f for f in features.ALL if f not in ("lugre", "voltage", "harmonic", "flexible"))


@cache
def known() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(solutions.FILE.read_text())
    return found


@pytest.mark.parametrize(("arm", "chosen"), sampled(solutions.jobs(["panda", "planar"]), 4))
def test_features_together(arm: str, chosen: tuple[str, ...]) -> None:
    """A second of a set under its command, under error control."""
    scene = features.scene(arm, chosen)
    sim = Simulator(scene, dt=DT, integrator="dop853", tolerance=TOLERANCE)
    if "payload" in chosen:
        load = features.LOAD
        payload_change(sim, 0, load["mass"], load["com"], load["inertia"])()
    command = features.command(arm, scene)
    run = sim.run(1.0, [command.get(name, 0.0) for name in sim.joint_names])
    ticks = np.rint(np.array(known()["time"]) / DT).astype(int)
    moved = max(np.ptp(run.kinetic), np.ptp(run.potential), run.lost[-1])
    wanted = known()[arm][solutions.label(chosen)]["q"]
    np.testing.assert_allclose(run.q[ticks], wanted, rtol=0.0, atol=POSITION)
    assert abs(run.balance).max() <= ACCOUNT * moved


def test_a_solution_is_found_again(rng: np.random.Generator) -> None:
    """The file is what the independent simulator makes, of a set that it makes quickly."""
    pairs = [pair for pair in features.sets(2) if set(pair) <= set(QUICK)]
    chosen = pairs[rng.integers(len(pairs))]
    print("features:", *chosen)
    found, stored = solutions.solved(("planar", chosen)), known()["planar"]
    wanted = stored[solutions.label(chosen)]["q"]
    np.testing.assert_allclose(found["q"], wanted, rtol=0.0, atol=1e-9)
    assert found["balance"] < 1e-9


@pytest.mark.parametrize("arm", features.ARMS)
def test_every_set_is_there_and_belongs_to_its_scene(arm: str) -> None:
    for _, chosen in solutions.jobs([arm]):
        assert known()[arm][solutions.label(chosen)]["scene"] == solutions.given(arm, chosen)[2]
