# SPDX-License-Identifier: Apache-2.0
"""Every method converges with the order it states, on a double pendulum whose motion is known to
17 digits; coefficients are those of SciPy.
"""

import json
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

import models
from arm_dynamics.codegen.kernel import operations
from arm_sim import Simulator
from arm_sim.integrators import METHODS, build_step
from arm_sim.plant.plant import Plant
from tolerances import CLOSED_FORM, ORDER, assert_close

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


@pytest.mark.parametrize("name", ["euler", "midpoint", "heun", "rk4", "nystrom4"])
def test_order_conditions(name: str) -> None:
    """One for each rooted tree of up to four nodes (Butcher, 1963; HNW, section II.2)."""
    tableau = METHODS[name].tableau
    assert tableau is not None
    A, b = np.zeros((len(tableau.b), len(tableau.b))), np.array(tableau.b)
    for row, weights in zip(A, tableau.a, strict=True):
        row[: len(weights)] = weights
    c = A @ np.ones(len(b))
    conditions = [
        [b.sum() - 1], [b @ c - 1 / 2], [b @ c**2 - 1 / 3, b @ A @ c - 1 / 6],
        [b @ c**3 - 1 / 4, b @ (c * (A @ c)) - 1 / 8,
         b @ A @ c**2 - 1 / 12, b @ A @ A @ c - 1 / 24],
    ]  # fmt: skip
    assert abs(np.concatenate(conditions[: tableau.order])).max() < CLOSED_FORM


@pytest.mark.parametrize(("name", "theirs"), [("dopri5", RK45), ("dop853", DOP853)])
def test_coefficients_are_those_of_scipy(name: str, theirs: Any) -> None:
    ours, stages = METHODS[name].tableau, len(theirs.B)
    assert ours is not None
    for row, wanted in zip(ours.a, theirs.A, strict=False):
        assert_close(row, wanted[: len(row)], 1e-15)
    assert_close(ours.b[:stages], theirs.B, 1e-15)
    errors = [theirs.E] if name == "dopri5" else [theirs.E5, theirs.E3]
    for own, wanted in zip(ours.errors, errors, strict=True):
        assert_close(np.abs(own), np.abs(wanted[: len(own)]), 1e-15)


def test_one_step_of_semi_implicit_euler_by_hand() -> None:
    """The new velocity first, then the position with it."""
    sim = models.simulator("two_link", integrator="semi_implicit_euler", dt=1e-2)
    q, v, tau = np.array([0.3, -0.8]), np.array([1.0, -2.0]), np.array([2.0, 1.0])
    sim.reset(q, v)
    v_after = v + 1e-2 * sim.dynamics.forward(q, v, tau)
    state = sim.step(tau)
    np.testing.assert_allclose(state.v, v_after, rtol=1e-13)
    np.testing.assert_allclose(state.q, q + 1e-2 * v_after, rtol=1e-13)


def test_what_depends_on_positions_is_computed_once_for_two_stages_of_nystrom4() -> None:
    plant = Plant(models.dynamics("panda").model)

    def counted(name: str) -> tuple[int, int]:
        step = build_step(METHODS[name], plant.rhs, plant.model.n)
        return operations(step), operations(step, {ca.OP_SIN: 1000}) - operations(step)

    (work, sines), (classical, all_sines) = counted("nystrom4"), counted("rk4")
    assert work < 0.91 * classical
    assert sines == 3 / 4 * all_sines
