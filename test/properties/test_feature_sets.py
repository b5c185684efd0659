# SPDX-License-Identifier: Apache-2.0
"""Random sets of features in one scene: the energy account closes, and runs repeat to the bit."""

from typing import Any

import numpy as np
import pytest
from samples import sampled

from arm_sim import Recording, Simulator
from models.features import ALL, TOUCHING, command, scene, sets


def allowed(chosen: tuple[str, ...]) -> float:
    """Part of that which may be missing: bristles run under error control."""
    return 1e-6 if "lugre" in chosen else 1e-8


def driven(sim: Simulator, arm: str, given: dict[str, Any], seconds: float) -> Recording:
    """A run under the command of the arm."""
    named = command(arm, given)
    return sim.run(seconds, [named.get(name, 0.0) for name in sim.joint_names])


def moved(run: Recording) -> float:
    """How much energy changed its form in [J]."""
    return float(max(np.ptp(run.kinetic), np.ptp(run.potential), run.lost[-1]))


@pytest.mark.parametrize("count", sampled([2, 3, 4, 5, 6, 7], 3))
def test_any_features_go_together_on_a_planar_arm(count: int, rng: np.random.Generator) -> None:
    possible = sets(count, (*ALL, *TOUCHING))
    chosen = possible[rng.integers(len(possible))]
    print("features:", *chosen)
    given = scene("planar", chosen)
    sim = Simulator(given, dt=5e-4)
    run = driven(sim, "planar", given, 0.5)
    assert moved(run) > 0.1
    assert abs(run.balance).max() < allowed(chosen) * moved(run)
    sim.reset()
    assert np.array_equal(driven(sim, "planar", given, 0.5).q, run.q)


def test_four_features_go_together_on_a_panda(rng: np.random.Generator) -> None:
    touching = {"contact", *TOUCHING}
    possible = [c for c in sets(4, (*ALL, *TOUCHING)) if touching & set(c)]
    chosen = possible[rng.integers(len(possible))]
    print("features:", *chosen)
    given = scene("panda", chosen)
    run = driven(Simulator(given, dt=5e-4), "panda", given, 0.3)
    assert abs(run.balance).max() < allowed(chosen) * moved(run)
