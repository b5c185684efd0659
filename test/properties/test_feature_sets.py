# SPDX-License-Identifier: Apache-2.0
"""Random sets of features in one scene: the energy account closes, and runs repeat to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from arm_sim import Recording, Simulator
from models.features import TOUCHING, scene, sets


def allowed(chosen: tuple[str, ...]) -> float:
    """Part of that which may be missing: bristles run under error control."""
    return 1e-6 if "lugre" in chosen else 1e-8


def moved(run: Recording) -> float:
    """How much energy changed its form in [J]."""
    return float(max(np.ptp(run.kinetic), np.ptp(run.potential), run.lost[-1]))


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 7])
def test_any_features_go_together_on_a_planar_arm(count: int, rng: np.random.Generator) -> None:
    possible = sets(count)
    chosen = possible[rng.integers(len(possible))]
    print("features:", *chosen)
    sim = Simulator(scene("planar", chosen), dt=5e-4)
    run = sim.run(0.5)
    assert moved(run) > 0.1
    assert abs(run.balance).max() < allowed(chosen) * moved(run)
    sim.reset()
    assert np.array_equal(sim.run(0.5).q, run.q)


def test_four_features_go_together_on_a_panda(rng: np.random.Generator) -> None:
    possible = [chosen for chosen in sets(4) if TOUCHING.keys() & set(chosen)]
    chosen = possible[rng.integers(len(possible))]
    print("features:", *chosen)
    run = Simulator(scene("panda", chosen), dt=5e-4).run(0.3)
    assert abs(run.balance).max() < allowed(chosen) * moved(run)
