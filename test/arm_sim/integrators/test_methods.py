# SPDX-License-Identifier: Apache-2.0
"""Every method converges with the order it states, on a double pendulum whose motion is known to
17 digits.
"""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import models
from arm_dynamics.codegen.kernel import operations
from arm_sim import Simulator
from arm_sim.integrators.methods import METHODS, build_attempt, build_step
from arm_sim.plant.plant import Plant
from tolerances import ALGEBRA, ORDER, assert_close

DATA = Path(__file__).parents[2] / "reference/double_pendulum.json"
# Two step sizes [s] for each order: small enough to be in the asymptotic range, large enough to
# stand above rounding.
STEPS = {
    1: (2**-12, 2**-13),
    2: (2**-9, 2**-10),
    4: (2**-7, 2**-8),
    5: (2**-6, 2**-7),
    8: (2**-3, 2**-4),
}


def error(method: str, dt: float) -> float:
    """Largest error of (q, v) after one second."""
    th1, th2, w1, w2 = (float(x) for x in json.loads(DATA.read_text())["pi6_pi4"]["1"])
    sim = Simulator(models.scene("double_pendulum"), integrator=method, dt=dt)
    sim.reset(q=[np.pi / 6, np.pi / 4 - np.pi / 6], v=[0.0, 0.0])
    run = sim.run(1.0)
    return float(np.abs(np.r_[run.q[-1], run.v[-1]] - [th1, th2 - th1, w1, w2 - w1]).max())


@pytest.mark.parametrize("name", METHODS)
def test_measured_order(name: str) -> None:
    coarse, fine = STEPS[METHODS[name].order]
    measured = np.log2(error(name, coarse) / error(name, fine)) / np.log2(coarse / fine)
    stated = METHODS[name].order
    # Beyond order 5 rounding is reached before the asymptotic range, where the order still looks
    # higher than it is.
    assert -ORDER <= measured - stated <= (ORDER if stated <= 5 else 2.0), (
        f"measured order {measured:.2f}"
    )


@pytest.mark.parametrize("name", METHODS)
def test_source_is_given(name: str) -> None:
    assert METHODS[name].name == name and any(
        character.isdigit() for character in METHODS[name].source
    )


def test_one_step_of_euler_by_hand() -> None:
    """q + h v and v + h a, from the old state."""
    sim = models.simulator("two_link", integrator="euler", dt=1e-2)
    q, v, tau = np.array([0.3, -0.8]), np.array([1.0, -2.0]), np.array([2.0, 1.0])
    sim.reset(q, v)
    a = sim.dynamics.forward(q, v, tau)
    state = sim.step(tau)
    np.testing.assert_allclose(state.q, q + 1e-2 * v, rtol=1e-14)
    np.testing.assert_allclose(state.v, v + 1e-2 * a, rtol=1e-13)


def test_one_step_of_semi_implicit_euler_by_hand() -> None:
    """The new velocity first, then the position with it."""
    sim = models.simulator("two_link", integrator="semi_implicit_euler", dt=1e-2)
    q, v, tau = np.array([0.3, -0.8]), np.array([1.0, -2.0]), np.array([2.0, 1.0])
    sim.reset(q, v)
    v_after = v + 1e-2 * sim.dynamics.forward(q, v, tau)
    state = sim.step(tau)
    np.testing.assert_allclose(state.v, v_after, rtol=1e-13)
    np.testing.assert_allclose(state.q, q + 1e-2 * v_after, rtol=1e-13)


def test_one_step_of_rk4_by_hand() -> None:
    sim = models.simulator("two_link", integrator="rk4", dt=1e-2)
    x, tau, h = np.array([0.3, -0.8, 1.0, -2.0]), np.array([2.0, 1.0]), 1e-2

    def rate(y: np.ndarray) -> np.ndarray:
        return np.r_[y[2:], sim.dynamics.forward(y[:2], y[2:], tau)]

    k1 = rate(x)
    k2 = rate(x + h / 2 * k1)
    k3 = rate(x + h / 2 * k2)
    k4 = rate(x + h * k3)
    sim.reset(x[:2], x[2:])
    state = sim.step(tau)
    np.testing.assert_allclose(
        np.r_[state.q, state.v], x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), rtol=1e-13
    )


def test_one_step_of_nystrom4_by_hand() -> None:
    sim = models.simulator("two_link", integrator="nystrom4", dt=1e-2)
    q, v, tau, h = np.array([0.3, -0.8]), np.array([1.0, -2.0]), np.array([2.0, 1.0]), 1e-2
    middle = q + h / 2 * v + h**2 / 8 * (k1 := sim.dynamics.forward(q, v, tau))
    k2 = sim.dynamics.forward(middle, v + h / 2 * k1, tau)
    k3 = sim.dynamics.forward(middle, v + h / 2 * k2, tau)
    k4 = sim.dynamics.forward(q + h * v + h**2 / 2 * k3, v + h * k3, tau)
    sim.reset(q, v)
    state = sim.step(tau)
    np.testing.assert_allclose(state.q, q + h * v + h**2 / 6 * (k1 + k2 + k3), rtol=1e-13)
    np.testing.assert_allclose(state.v, v + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), rtol=1e-13)


def test_what_depends_on_positions_is_computed_once_for_two_stages_of_nystrom4() -> None:
    plant = Plant(models.dynamics("panda").model)

    def counted(name: str) -> tuple[int, int]:
        step = build_step(METHODS[name], plant.rhs, plant.model.n)
        return operations(step), operations(step, {ca.OP_SIN: 1000}) - operations(step)

    (work, sines), (classical, all_sines) = counted("nystrom4"), counted("rk4")
    assert work < 0.91 * classical
    assert sines == 3 / 4 * all_sines


@pytest.mark.parametrize("rate", [0.5, -0.5])
@pytest.mark.parametrize("name", ["dopri5", "dop853"])
def test_an_error_counts_relative_to_the_larger_end_of_a_step(name: str, rate: float) -> None:
    """|error| / (scale + max(|before|, |after|)) of the worst number; here each error is a share
    of the number itself.
    """
    x, u, p = (ca.MX.sym(symbol, size) for symbol, size in (("x", 2), ("u", 1), ("p", 1)))
    grow = ca.Function("grow", [x, u, p], [rate * x])
    attempt = build_attempt(METHODS[name], grow, 1, np.array([1.0, 10.0]))

    def tried(*start: float) -> tuple[np.ndarray, float]:
        after, error, _ = attempt(list(start), 0.0, 0.0, 1.0)
        return after.full().ravel(), float(error)

    tiny, large = 1e-9, 1e9
    after, error = tried(tiny, 0.0)
    share, larger = error / tiny, max(1.0, after[0] / tiny)
    assert_close(tried(0.0, tiny)[1] / (share * tiny), 0.1, 1e-6)
    assert_close(tried(large, 0.0)[1] / share, 1.0 / larger, 1e-6)
    assert_close(tried(1.0, 0.0)[1] / share, 1.0 / (1.0 + larger), 1e-6)
    assert_close(tried(large, 1.0)[1], tried(large, 0.0)[1], ALGEBRA)
