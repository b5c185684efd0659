# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a tick against finite differences and closed forms."""

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import SimulationDiverged
from tolerances import assert_close


def test_gantry_by_hand() -> None:
    """Constant mass and no friction: q + h v + h² tau / 2m, v + h tau / m."""
    sim = models.simulator("gantry", integrator="rk4", dt=1e-2)
    A, B = sim.linearize(sim.state, [0.0, 0.0])
    h, per_mass = 1e-2, np.diag([1 / 15, 1 / 3])
    assert_close(A, np.block([[np.eye(2), h * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]]), 1e-14)
    assert_close(B, np.vstack([h**2 / 2 * per_mass, h * per_mass]), 1e-14)


def test_does_not_move_the_simulation() -> None:
    sim = models.simulator("two_link")
    before = sim.step([1.0, 0.5])
    sim.linearize(before, [0.0, 0.0], 3)
    assert sim.state is before


@pytest.mark.parametrize("options", [
    {"integrator": "rk4"}, {"integrator": "rk4", "backend": "vm"}, {"tolerance": 1e-9},
], ids=str)  # fmt: skip
def test_a_tick_that_diverges_has_no_derivative(options: dict[str, Any]) -> None:
    """As it has no state after it, even where its numbers are finite."""
    sim = models.simulator("gantry", stops=False, **options)
    for speed, diverges in ((1e140, False), (1e160, True), (1e308, True)):
        state = sim.reset([0.0, 0.0], [speed, 0.0])
        with pytest.raises(SimulationDiverged) if diverges else nullcontext():
            assert np.isfinite(np.hstack(sim.linearize(state, [0.0, 0.0]))).all()
        with pytest.raises(SimulationDiverged) if diverges else nullcontext():
            sim.step([0.0, 0.0])


def test_a_smoothed_tick_that_diverges_is_refused_by_its_arm() -> None:
    """Beyond the stops too, which a smoothed tick ignores, others have derivatives."""
    linearizer = models.simulator("gantry").arm.compiled.derivatives.linearizer()
    x = np.outer([0.0, 1e140, 1e160], [0, 0, 1, 0])
    assert np.isfinite(linearizer.smoothed_jacobians(x[:2], np.zeros((2, 2)), 0.1, None)).all()
    with pytest.raises(SimulationDiverged, match="^arm 2: linearize: .* cannot be computed"):
        linearizer.smoothed_jacobians(x, np.zeros((3, 2)), 0.1, None)


def test_beyond_the_limit_torque_has_no_effect() -> None:
    """The torque is cut, so the derivative by it is zero."""
    sim = models.simulator("two_link")
    _, B = sim.linearize(sim.state, [1e4, 0.0])
    np.testing.assert_array_equal(B[:, 0], np.zeros(4))
    assert np.abs(B[:, 1]).max() > 0.0


@pytest.mark.parametrize(
    ("tau", "ticks"),
    [([0.0], 1), ([np.nan, 0.0], 1), ([0.0, 0.0], 0), ([0.0, 0.0], -1), ([0.0, 0.0], 1.5)],
)
def test_refusals(tau: list[float], ticks: Any) -> None:
    sim = models.simulator("two_link")
    with pytest.raises(InvalidInput):
        sim.linearize(sim.state, tau, ticks)
