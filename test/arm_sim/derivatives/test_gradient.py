# SPDX-License-Identifier: Apache-2.0
"""Gradients of functions of a rollout's states: against differences of rollouts, and A and B."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_sim import SimulationDiverged, Simulator
from models import features
from models.sprung import slope
from tolerances import FINITE_DIFF, assert_close

GRADIENT = 1e-9
"""Gradients against differences of eighth order, relative to the largest."""

STEPS, ARMS = 12, 3


def difference(L: Callable[[np.ndarray], float], at: np.ndarray, h: float) -> np.ndarray:
    """Gradient of L by every number of an array."""
    return slope(lambda x: L(x.reshape(at.shape)), at.ravel(), h).reshape(at.shape)


def start(sim: Simulator, arms: int = ARMS) -> tuple[np.ndarray, ...]:
    """Initial states, torques of every tick, and weights g."""
    rng = np.random.default_rng(5)
    n = sim.n
    q0 = sim.model.q0 + 0.1 * rng.normal(size=(arms, n))
    v0, tau = 0.3 * rng.normal(size=(arms, n)), 0.5 * rng.normal(size=(arms, STEPS, n))
    return q0, v0, tau, rng.normal(size=(arms, STEPS + 1, 2 * n))


def compare(
    sim: Simulator, h: float = 1e-3, arms: int = ARMS, tolerance: float = GRADIENT
) -> None:
    q0, v0, tau, g = start(sim, arms)

    def L(**changed: Any) -> float:
        given = {"q0": q0, "v0": v0, "tau": tau} | changed
        return float((g * sim.rollout(**given, steps=STEPS)).sum())

    found = sim.rollout_gradient(q0, v0, tau, STEPS, g)
    assert_close(found.q0, difference(lambda q: L(q0=q), q0, h), tolerance)
    assert_close(found.v0, difference(lambda v: L(v0=v), v0, h), tolerance)

    def at(some: np.ndarray) -> np.ndarray:
        whole = tau.copy()
        whole[:, ::5] = some
        return whole

    by_tau = difference(lambda u: L(tau=at(u)), tau[:, ::5], h)
    assert_close(found.tau[:, ::5], by_tau, tolerance)


@pytest.mark.parametrize("method", ["semi_implicit_euler", "nystrom4", "dopri5"])
def test_methods(method: str) -> None:
    compare(models.simulator("skew_axes", stops=False, integrator=method, dt=0.02))


@cache
def featured(*chosen: str, **options: Any) -> Simulator:
    scene = features.scene("planar", chosen)
    return Simulator(scene, dt=1e-3, **({"integrator": "rk4"} | options))


SMOOTH = ("viscous", "armature", "spring", "point spring", "payload", "mimic")


def test_loads_and_springs_by_their_parameters_too() -> None:
    sim = featured(*SMOOTH)
    compare(sim)
    q0, v0, tau, g = start(sim)
    load = np.tile([0.8, 0.01, 0.02, 0.08, 2e-3, 1e-4, 0.0, 3e-3, 0.0, 2e-3], (ARMS, 1))

    def L(payload: np.ndarray) -> float:
        motion = sim.rollout(q0, v0, tau, STEPS, parameters={"payload": payload})
        return float((g * motion).sum())

    found = sim.rollout_gradient(q0, v0, tau, STEPS, g, parameters={"payload": load})
    wanted = difference(L, load, 1e-5)
    assert_close(found.parameters["payload"], wanted, 1e-8)


def test_states_of_drives_begin_where_they_suit_and_steps_under_error_control_are_given() -> None:
    """The motor of a flexible joint begins where the joint is; differences see the tolerance."""
    compare(featured("flexible"), h=1e-4, arms=1)
    compare(featured("current", integrator=None, tolerance=1e-11), 1e-4, 1, FINITE_DIFF)


def test_an_arm_that_diverges_is_named() -> None:
    """The second of three: with numbers that overflow, or that stay finite and are too large."""
    sim = models.simulator("skew_axes", stops=False, integrator="rk4")
    for much in (1e6, 1e160):
        q0, v0, tau, g = start(sim)
        v0[1] *= much
        with pytest.raises(SimulationDiverged, match="^arm 1, time step "):
            sim.rollout_gradient(q0, v0, tau, STEPS, g)
        with pytest.raises(SimulationDiverged, match="arm 1"):
            sim.rollout_jvp(q0, v0, tau, STEPS, dq0=q0, dv0=q0, dtau=tau)


def test_arms_and_lanes_are_alike() -> None:
    """To the bit; torques that are shared get the sum, and held ones change in every tick."""
    sim = models.simulator("skew_axes", stops=False, integrator="rk4")
    q0, v0, tau, g = start(sim, 11)
    changes = q0, v0, tau[:, 1]
    products = [
        sim.rollout_jvp(q0, v0, tau, STEPS, *changes, lanes=lanes, threads=threads)
        for lanes, threads in ((4, 1), (1, 2))
    ]
    np.testing.assert_array_equal(*products)
    each = np.repeat(tau[:, 1:2], STEPS, 1)
    assert_close(products[0], sim.rollout_jvp(q0, v0, tau, STEPS, q0, v0, each), 1e-13)
    wide = sim.rollout_gradient(q0, v0, tau, STEPS, g, lanes=4, threads=1)
    narrow = sim.rollout_gradient(q0, v0, tau, STEPS, g, lanes=1, threads=2)
    for name in ("q0", "v0", "tau"):
        np.testing.assert_array_equal(getattr(wide, name), getattr(narrow, name))
    held = sim.rollout_gradient(q0, v0, tau[:, 0], STEPS, g)
    shared = sim.rollout_gradient(q0, v0, tau[0, 0], STEPS, g)
    assert held.tau.shape == (11, sim.n) and shared.tau.shape == (sim.n,)
    same = sim.rollout_gradient(q0, v0, np.repeat(tau[:, :1], STEPS, 1), STEPS, g)
    assert_close(held.tau, same.tau.sum(axis=1), 1e-13)


@pytest.mark.parametrize("chosen", [SMOOTH, ("coulomb", "payload"), ("flexible",)])
def test_along_a_direction(chosen: tuple[str, ...]) -> None:
    """g · (J d) = (Jᵀ g) · d, for smooth ticks, with events and where laws have states."""
    sim = featured(*chosen)
    q0, v0, tau, g = start(sim)
    rng = np.random.default_rng(8)
    dq0, dv0 = rng.normal(size=(2, ARMS, sim.n))
    dtau = rng.normal(size=(ARMS, STEPS, sim.n))
    change = sim.rollout_jvp(q0, v0, tau, STEPS, dq0, dv0, dtau)
    found = sim.rollout_gradient(q0, v0, tau, STEPS, g)
    product = (found.q0 * dq0).sum() + (found.v0 * dv0).sum() + (found.tau * dtau).sum()
    assert change.shape == (ARMS, STEPS + 1, 2 * sim.n)
    np.testing.assert_array_equal(change[:, 0], np.hstack([dq0, dv0]))
    assert_close((g * change).sum(), product, 1e-11)


@pytest.mark.parametrize(("chosen", "ticks"), [(SMOOTH, 3), (("coulomb", "flexible"), 2)])
def test_products_with_a_tick_are_those_with_A_and_B(chosen: tuple[str, ...], ticks: int) -> None:
    sim = featured(*chosen)
    state, tau = sim.reset(sim.model.q0, [0.8, -0.5, 0.6]), np.array([2.0, 1.0, 0.1])
    A, B = sim.linearize(state, tau, ticks)
    rng = np.random.default_rng(4)
    dx, dtau, weights = (rng.normal(size=size) for size in (len(A), sim.n, len(A)))
    assert_close(sim.jvp(state, tau, dx, dtau, ticks), A @ dx + B @ dtau, 1e-13)
    by_x, by_tau = sim.vjp(state, tau, weights, ticks)
    assert_close(by_x, A.T @ weights, 1e-13)
    assert_close(by_tau, B.T @ weights, 1e-13)


Q = np.zeros((2, 2))
ROLLED = {"q0": Q, "v0": Q, "tau": np.zeros(2), "steps": 1}
ALONG = ROLLED | {"dq0": Q, "dv0": Q, "dtau": Q}


@pytest.mark.parametrize(
    ("function", "given", "name", "bad"),
    [
        ("rollout_gradient", ROLLED, "g", np.full((2, 2, 4), np.nan)),
        ("rollout_gradient", ROLLED | {"g": np.zeros((2, 2, 4))}, "lanes", 5),
        ("rollout_gradient", ROLLED | {"g": np.zeros((2, 2, 4))}, "mass", {"mass": 1.0}),
        ("rollout_jvp", ALONG, "dv0", np.zeros((2, 3))),
        ("rollout_jvp", ALONG, "dtau", [np.nan, 0.0]),
        ("jvp", {"tau": np.zeros(2), "dx": np.zeros(4)}, "dtau", [np.inf, 0.0]),
        ("vjp", {"tau": np.zeros(2)}, "weights", np.zeros(3)),
    ],
)
def test_refusals(function: str, given: dict[str, Any], name: str, bad: Any) -> None:
    sim = models.simulator("two_link")
    given = given if "q0" in given else given | {"state": sim.state}
    with pytest.raises(InvalidInput, match=name):
        getattr(sim, function)(**given | ({"parameters": bad} if name == "mass" else {name: bad}))
