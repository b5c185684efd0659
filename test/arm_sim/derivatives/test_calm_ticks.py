# SPDX-License-Identifier: Apache-2.0
"""Ticks without events in scenes with events: compiled code against the path through events."""

from typing import Any

import numpy as np
import pytest

from arm_sim import NotDifferentiable, Simulator
from arm_sim.derivatives import Linearizer
from models import features
from tolerances import ALGEBRA, assert_close

BY = ("payload",)
SCENES: dict[str, tuple[str, ...]] = {
    "dry friction, a table of levels, a lossy gear": ("coulomb", "table", "lossy gear", "payload"),
    "drives and dry friction": ("current", "coulomb", "flexible", "payload"),
}


def by_events(simulator: Simulator, tuned: tuple[int, ...] = ()) -> Linearizer:
    """Differentiates every tick segment by segment."""
    compiled = simulator.arm.compiled
    arguments = compiled.plant, compiled.choice, compiled.stepper, compiled.backend, tuned
    linearizer = Linearizer(*arguments)
    vars(linearizer.ticks.compiled).update(smooth_ticks=None, event_free=None)
    return linearizer


def visited(simulator: Simulator, ticks: int = 240, every: int = 12) -> list[Any]:
    """States that a random motion passes, at rest at first, with the commands under which."""
    rng, n = np.random.default_rng(3), simulator.n
    hold = simulator.dynamics.gravity(simulator.model.q0)
    command, found = hold, []
    for k in range(ticks):
        if k % 40 == 20:
            command = hold + rng.normal(size=n) * (1.0 + 0.3 * abs(hold))
        if k % every == 0:
            found.append((simulator.arm.x.copy(), np.array(command)))
        simulator.step(command)
    return found


def outcome(linearizer: Linearizer, x: np.ndarray, tau: np.ndarray, side: int | None) -> Any:
    try:
        return linearizer(x, tau, 1, side)
    except NotDifferentiable as refused:
        return str(refused)


@pytest.mark.parametrize("name", SCENES)
def test_compiled_ticks_are_those_of_the_path_through_events(name: str) -> None:
    simulator = Simulator(features.scene("planar", SCENES[name]), integrator="rk4", dt=1e-3)
    places = simulator.arm.plant.parameters.places(BY)
    tuned = tuple(i for own in places.values() for i in own)
    fast = simulator.arm.compiled.derivatives.linearizer(tuned)
    slow, p, event_free = by_events(simulator, tuned), simulator.arm.parameters, 0
    for x, tau in visited(simulator):
        for side in (None, 1):
            found, expected = (outcome(of, x, tau, side) for of in (fast, slow))
            if isinstance(expected, str):
                assert found == expected
            else:
                assert_close(found, expected, ALGEBRA)
        event_free += not fast.ticks.compiled.event_free.slopes(x[None], tau[None], p, 1, 1, 1)[2]  # type: ignore[union-attr]
    assert event_free >= 10  # of 20
