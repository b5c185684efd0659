# SPDX-License-Identifier: Apache-2.0
"""The state in the middle of a step, against SciPy's solution there."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from arm_sim.integrators import METHODS, build_step
from arm_sim.integrators.continuous import middle_weights, needs_slope_at_end
from arm_sim.integrators.tableaux import (
    DOP853,
    DORMAND_PRINCE,
    EULER,
    HEUN,
    MIDPOINT,
    RK4,
    Tableau,
)
from tolerances import ORDER

X = np.array([0.7, 0.5])


def slope(x: np.ndarray) -> np.ndarray:
    return np.array([x[1], -np.sin(x[0]) * x[1] - x[0]])


def error_in_the_middle(tableau: Tableau, h: float) -> float:
    stages: list[np.ndarray] = []
    for row in tableau.a:
        stages.append(
            slope(X + h * sum((w * k for w, k in zip(row, stages, strict=True)), np.zeros(2)))
        )
    if needs_slope_at_end(tableau):
        stages.append(slope(X + h * sum(w * k for w, k in zip(tableau.b, stages, strict=True))))
    found = X + h * sum(w * k for w, k in zip(middle_weights(tableau), stages, strict=True))
    solved = solve_ivp(lambda _, x: slope(x), (0, h / 2), X, "DOP853", rtol=1e-13, atol=1e-15)
    return float(abs(found - solved.y[:, -1]).max())


def test_order_of_the_middle_of_nystrom4() -> None:
    """As of RK4, and the slope that its last stage gives for the end is of the same order."""
    x, none = ca.SX.sym("x", 2), ca.SX.sym("none", 0)
    rhs = ca.Function("rhs", [x, none, none], [ca.vertcat(x[1], -ca.sin(x[0]) * x[1] - x[0])])
    step = build_step(METHODS["nystrom4"], rhs, 1, dense=True)
    errors = []
    for h in (0.2, 0.1):
        solved = solve_ivp(
            lambda _, x: slope(x), (0, h), X, "DOP853", rtol=1e-13, atol=1e-15, t_eval=[h / 2, h]
        )
        _, first, last, middle = (np.array(part).ravel() for part in step(X, [], [], h))
        np.testing.assert_array_equal(first, slope(X))
        ends = last - slope(solved.y[:, 1]), middle - solved.y[:, 0]
        errors.append([abs(end).max() for end in ends])
    orders = np.log2(np.divide(*errors))
    assert orders[0] > 3 - ORDER
    assert orders[1] == pytest.approx(4, abs=ORDER)


@pytest.mark.parametrize(
    ("tableau", "order"),
    [(EULER, 1), (MIDPOINT, 2), (HEUN, 2), (RK4, 3), (DORMAND_PRINCE, 4), (DOP853, 6)],
    ids=["euler", "midpoint", "heun", "rk4", "dopri5", "dop853"],
)
def test_order_of_the_middle(tableau: Tableau, order: int) -> None:
    """The state in the middle has the order that the stages allow."""
    coarse, fine = (error_in_the_middle(tableau, h) for h in (0.2, 0.1))
    assert np.log2(coarse / fine) == pytest.approx(order + 1, abs=ORDER)


@pytest.mark.parametrize("name", [name for name in METHODS if name != "implicit"])
def test_every_method_follows_the_motion_inside_its_step(name: str) -> None:
    x, none = ca.SX.sym("x", 2), ca.SX.sym("none", 0)
    rhs = ca.Function("rhs", [x, none, none], [ca.vertcat(x[1], -ca.sin(x[0]) * x[1] - x[0])])
    step, h = build_step(METHODS[name], rhs, 1, dense=True), 0.02
    after, first, last, middle = (np.array(part).ravel() for part in step(X, [], [], h))
    solved = solve_ivp(
        lambda _, x: slope(x), (0, h), X, "DOP853", rtol=1e-13, atol=1e-15, t_eval=[h / 2, h]
    )
    np.testing.assert_allclose(np.transpose([middle, after]), solved.y, atol=h**2)
    np.testing.assert_allclose([first, last], [slope(X), slope(solved.y[:, 1])], atol=2.5 * h)
