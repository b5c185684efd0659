# SPDX-License-Identifier: Apache-2.0
"""Arms thrown about at random, with torques and states of any size: they go on, or say why not.

``--fuzz N`` makes the test N times as long; ``tools/sanitize.py`` runs it under sanitizers.
"""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics.codegen.compiler import find_compiler
from arm_dynamics.exceptions import ArmError
from arm_sim import Simulator
from arm_sim.exceptions import SimulationDiverged

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

TABLE = {"frame": "world", "point": [0.0, 0.0, -0.6]}
SCENES: dict[str, dict[str, Any]] = {
    "dry friction and stops": {
        "joints": {
            "*": {"friction": {"coulomb": 0.2, "static": 0.3, "viscous": 0.1}},
            "elbow": {"limits": {"lower": -1.0, "upper": 1.0, "stop": {"restitution": 0.4}}},
        }
    },
    "two contacts": {
        "constraints": [
            {
                "type": "contact", "name": f"c{k}", "frame": "forearm", "point": [x, 0.0, 0.0],
                "plane": TABLE, "friction": 0.4, "restitution": 0.3,
            }
            for k, x in enumerate((0.2, 0.5))
        ]
    },
}  # fmt: skip


@pytest.mark.parametrize("features", SCENES)
def test_thrown_about(features: str, rng: np.random.Generator, fuzz: int) -> None:
    made = models.scene("two_link").model_dump(exclude_unset=True) | SCENES[features]
    sim, lost = Simulator(made), 0
    for _ in range(30 * fuzz):
        try:
            sim.set_state(
                *rng.uniform(-1.0, 1.0, (2, 2)) * rng.choice([0.0, 1.0, 1.0, 1e3, 1e155])
            )
        except ArmError:
            lost += 1
        for _ in range(20):
            tau = rng.normal(size=2) * rng.choice([0.0, 1.0, 10.0, 1e4, 1e200])
            before = sim.state
            try:
                sim.step(tau)
            except SimulationDiverged:
                assert sim.state == before or np.array_equal(sim.state.q, before.q)
                lost += 1
                break
            assert np.isfinite([sim.state.q, sim.state.v]).all()
    assert lost < 20 * fuzz  # most of it is motion


def test_joints_that_meet_their_stops_do_not_chatter() -> None:
    """Two that lie at stops and take a blow in turn come to rest: no tick has to be cut short."""
    sim = Simulator(models.scene("panda"))
    draw = np.random.default_rng(1)
    for _ in range(150):
        sim.run(0.02, np.clip(draw.normal(0.0, 30.0, 7), -12.0, 12.0))
    assert sim.impacts > 50
    assert sim.state.time_stepped == 0
