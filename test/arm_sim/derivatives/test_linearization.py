# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of a tick against finite differences and closed forms."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest
from samples import covering

import models
from arm_dynamics import InvalidInput
from arm_sim import SimulationDiverged, Simulator
from tolerances import FINITE_DIFF, assert_close


def difference(
    sim: Simulator, q: np.ndarray, v: np.ndarray, tau: np.ndarray, ticks: int
) -> np.ndarray:
    """(A, B) side by side, by central differences of simulated ticks."""
    n, h = sim.n, 1e-5
    point = np.r_[q, v, tau]

    def after(x: np.ndarray) -> np.ndarray:
        sim.reset(x[:n], x[n : 2 * n])
        for _ in range(ticks):
            state = sim.step(x[2 * n :])
        return np.r_[state.q, state.v]

    return np.column_stack(
        [(after(point + h * e) - after(point - h * e)) / (2 * h) for e in np.eye(3 * n)]
    )


OPTIONS: list[dict[str, Any]] = [
    {"integrator": "euler"},
    {"integrator": "semi_implicit_euler"},
    {"integrator": "rk4"},
    {"tolerance": 1e-12, "dt": 0.05},
]


@pytest.mark.parametrize(
    ("ticks", "name", "options"),
    covering([1, 5], ["two_link", "gripper", "skew_axes"], OPTIONS),
    ids=str,
)
def test_against_finite_differences(
    name: str, options: dict[str, Any], ticks: int, rng: np.random.Generator
) -> None:
    sim = models.simulator(name, stops=False, **options)
    q, v, tau = 0.5 * rng.normal(size=(3, sim.n))
    state = sim.reset(q, v)
    A, B = sim.linearize(state, tau, ticks)
    assert_close(np.column_stack([A, B]), difference(sim, q, v, tau, ticks), FINITE_DIFF)


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
