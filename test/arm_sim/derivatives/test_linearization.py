# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a tick against closed forms; of many arms, each is as alone."""

from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import SimulationDiverged, Simulator
from tolerances import BACKENDS, assert_close


def test_gantry_by_hand() -> None:
    """Constant mass and no friction: q + h v + h² tau / 2m, v + h tau / m."""
    sim = models.simulator("gantry", integrator="rk4", dt=1e-2)
    A, B = sim.linearize(sim.state, [0.0, 0.0])
    h, per_mass = 1e-2, np.diag([1 / 15, 1 / 3])
    assert_close(A, np.block([[np.eye(2), h * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]]), 1e-14)
    assert_close(B, np.vstack([h**2 / 2 * per_mass, h * per_mass]), 1e-14)


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
    """The torque is cut, so the derivative by it is zero; the simulation does not move."""
    sim = models.simulator("two_link")
    before = sim.step([1.0, 0.5])
    _, B = sim.linearize(before, [1e4, 0.0])
    assert sim.state is before
    np.testing.assert_array_equal(B[:, 0], np.zeros(4))
    assert np.abs(B[:, 1]).max() > 0.0


def many(sim: Simulator, arms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    q = sim.model.q0 + 0.2 * rng.uniform(-1, 1, (arms, sim.n))
    return q, rng.normal(size=(arms, sim.n)), rng.normal(size=(arms, sim.n))


def test_many_are_each_alone() -> None:
    """To the bit, whatever the lanes and threads; the last group is not full."""
    ticks, sim = 3, models.simulator("skew_axes", stops=False, integrator="rk4")
    q, v, tau = many(sim, 11)
    wide, narrow = (
        sim.linearize_many(q, v, tau, ticks, lanes=lanes, threads=threads)
        for lanes, threads in ((4, 1), (1, 2))
    )
    for one, other in zip(wide, narrow, strict=True):
        np.testing.assert_array_equal(one, other)
    for arm in range(len(q)):
        A, B = sim.linearize(sim.reset(q[arm], v[arm]), tau[arm], ticks)
        np.testing.assert_array_equal(wide[0][arm], A)
        np.testing.assert_array_equal(wide[1][arm], B)


def test_many_with_events() -> None:
    """An arm that meets its stop goes its own way among those that do not."""
    sim = models.simulator("two_link", integrator="rk4", dt=1e-2)
    place = sim.model.stops.place[1]
    q = np.array([[0.1, 0.2], [place[0] - 1e-3, 0.2], [0.3, -0.1]])
    v = np.array([[0.1, 0.2], [0.5, 0.0], [0.0, 0.4]])
    A, B = sim.linearize_many(q, v, np.zeros(2))
    for arm in range(3):
        alone = sim.linearize(sim.reset(q[arm], v[arm]), np.zeros(2))
        np.testing.assert_array_equal(A[arm], alone[0])
        np.testing.assert_array_equal(B[arm], alone[1])
    assert np.abs(A[1] - A[0]).max() > 0.1  # it bounced


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros((0, 2))}, r"^q has shape \(0, 2\)"),
        ({"v": np.zeros((3, 2))}, "^v: 3 arms"),
        ({"tau": [np.nan, 0.0]}, "finite"),
        ({"ticks": 0}, "ticks"),
        ({"lanes": 3}, "lanes"),
        ({"threads": 0}, "threads"),
    ],
)
def test_refusals(change: dict[str, Any], message: str) -> None:
    sim = models.simulator("two_link")
    given = {"q": np.zeros((2, 2)), "v": np.zeros((2, 2)), "tau": np.zeros(2)} | change
    with pytest.raises(InvalidInput, match=message):
        sim.linearize_many(**given)
    if "ticks" in change or "tau" in change:
        with pytest.raises(InvalidInput, match=message):
            sim.linearize(sim.state, given["tau"], given.get("ticks", 1))


def test_without_a_compiler() -> None:
    """The same functions run on the virtual machine."""
    options = {"tolerance": 1e-9, "dt": 0.02}
    found = []
    for backend in ("auto", "vm"):
        sim = models.simulator("skew_axes", stops=False, backend=backend, **options)
        q, v, tau = many(sim, 2)
        found.append(np.concatenate(sim.linearize_many(q, v, tau), axis=2))
    assert_close(found[0], found[1], BACKENDS)
