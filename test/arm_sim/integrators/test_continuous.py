# SPDX-License-Identifier: Apache-2.0
"""The state in the middle of a step and the slopes at its ends, against SciPy's solution."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from arm_sim.integrators import METHODS, build_step
from tolerances import ORDER

X = np.array([0.7, 0.5])
# Of errors of the middle, one more than the order that the stages allow, and of the slope at the
# end.
ORDERS = {
    "euler": (2, 1), "semi_implicit_euler": (2, 2), "midpoint": (3, 2), "heun": (3, 2),
    "rk4": (4, 3), "nystrom4": (4, 3), "dopri5": (5, 6), "dop853": (7, 9),
}  # fmt: skip


def slope(x: np.ndarray) -> np.ndarray:
    return np.array([x[1], -np.sin(x[0]) * x[1] - x[0]])


def errors(name: str, h: float) -> np.ndarray:
    """Of the state in the middle and of the slopes at both ends of a step."""
    x, none = ca.SX.sym("x", 2), ca.SX.sym("none", 0)
    rhs = ca.Function("rhs", [x, none, none], [ca.vertcat(x[1], -ca.sin(x[0]) * x[1] - x[0])])
    step = build_step(METHODS[name], rhs, 1, dense=True)
    _, first, last, middle = (np.array(part).ravel() for part in step(X, [], [], h))
    solved = solve_ivp(
        lambda _, x: slope(x), (0, h), X, "DOP853", rtol=1e-13, atol=1e-15, t_eval=[h / 2, h]
    )
    off = middle - solved.y[:, 0], last - slope(solved.y[:, 1]), first - slope(X)
    return np.max(np.abs(off), axis=1)


@pytest.mark.parametrize("name", ORDERS)
def test_orders_inside_a_step(name: str) -> None:
    coarse, fine = errors(name, 0.2), errors(name, 0.1)
    assert coarse[2] == fine[2] == 0.0
    np.testing.assert_allclose(np.log2(coarse[:2] / fine[:2]), ORDERS[name], atol=ORDER)


def test_every_explicit_method_is_there() -> None:
    assert ORDERS.keys() == METHODS.keys() - {"implicit"}
