# SPDX-License-Identifier: Apache-2.0
"""Random sets of features in one scene: the energy account closes, and runs repeat to the bit."""

import numpy as np
import pytest
from samples import sampled

from arm_sim import Simulator
from models.features import ALL, TOUCHING, command, scene, sets


@pytest.mark.parametrize("count", sampled([2, 3, 4, 5, 6, 7], 3))
def test_any_features_go_together_on_a_planar_arm(count: int, rng: np.random.Generator) -> None:
    possible = sets(count, (*ALL, *TOUCHING))
    chosen = possible[rng.integers(len(possible))]
    print("features:", *chosen)
    given = scene("planar", chosen)
    sim, named = Simulator(given, dt=5e-4), command("planar", given)
    torques = [named.get(name, 0.0) for name in sim.joint_names]
    run = sim.run(0.5, torques)
    moved = max(np.ptp(run.kinetic), np.ptp(run.potential), run.lost[-1])
    allowed = 1e-6 if "lugre" in chosen else 1e-8  # bristles run under error control
    assert abs(run.balance).max() < allowed * moved and moved > 0.1
    sim.reset()
    assert np.array_equal(sim.run(0.5, torques).q, run.q)
