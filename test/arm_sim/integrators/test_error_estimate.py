# SPDX-License-Identifier: Apache-2.0
"""The scaled error of a step, computed once more from its stages."""

import casadi as ca
import numpy as np
import pytest

from arm_sim.integrators import METHODS, build_step
from tolerances import assert_close

A = np.array([[0.0, 1.0, 0.0], [-30.0, -2.0, 5.0], [1.0, -40.0, -60.0]])
"""Of a system x' = A x + u with one position, one speed and one state of a law."""
SCALE = np.array([1.0, 1.0, 7.0])


def rhs() -> ca.Function:
    x, u, p = (ca.SX.sym(name, size) for name, size in (("x", 3), ("u", 1), ("p", 0)))
    return ca.Function("rhs", [x, u, p], [ca.DM(A) @ x + ca.vertcat(0, u, 0)])


def by_hand(name: str, x: np.ndarray, u: float, h: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """State after a step, and the method's estimates of its error."""
    tableau = METHODS[name].tableau
    assert tableau is not None
    slopes: list[np.ndarray] = []
    for row in tableau.a:
        moved = sum((a * k for a, k in zip(row, slopes, strict=True)), np.zeros(3))
        slopes.append(A @ (x + h * moved) + [0, u, 0])
    k = np.array(slopes)
    return x + h * np.array(tableau.b) @ k, [h * np.array(e) @ k for e in tableau.errors]


@pytest.mark.parametrize("name", ["dopri5", "dop853"])
@pytest.mark.parametrize(("size", "h"), [(1e-3, 1e-3), (100.0, 0.05)])
def test_relative_to_the_larger_end_and_what_matters(
    name: str, size: float, h: float, rng: np.random.Generator
) -> None:
    """max |e| / (scale + max(|x|, |y|)); DOP853 mixes two, as Hairer does in his DOP853."""
    attempt = build_step(METHODS[name], rhs(), 1, scale=SCALE)
    for _ in range(10):
        x, u = size * rng.normal(size=3), float(rng.normal())
        after, error, error_q = (np.array(value).ravel() for value in attempt(x, u, [], h))
        wanted, estimates = by_hand(name, x, u, h)
        assert_close(after, wanted, 1e-12)
        reach = SCALE + np.maximum(abs(x), abs(wanted))
        norms = [float(np.max(abs(e) / reach)) for e in estimates]
        mixed = norms[0]
        if len(norms) == 2:
            mixed = norms[0] ** 2 / np.sqrt(norms[0] ** 2 + 0.01 * norms[1] ** 2)
        np.testing.assert_allclose(error[0], mixed, rtol=1e-6, atol=1e-17)
        np.testing.assert_allclose(error_q[0], abs(estimates[0][0]), rtol=1e-6, atol=1e-16)


@pytest.mark.parametrize(("gap", "gap_v"), [(0.5, 0.25), (0.25, 0.5), (0.0, 0.0)])
def test_what_a_projection_removes_is_error(gap: float, gap_v: float) -> None:
    """The gap of positions counts as error of the positions, too."""
    x, after, p = (ca.SX.sym(name, size) for name, size in (("x", 2), ("after", 2), ("p", 0)))
    project = ca.Function("project", [x, after, p], [0.5 * after, ca.SX(gap), ca.SX(gap_v)])
    start, h = np.array([1.0, -0.5, 2.0]), 1e-3
    plain, found = (
        [np.array(value).ravel() for value in build_step(METHODS["dopri5"], rhs(), 1, between,
                                                         scale=SCALE)(start, 1.0, [], h)]
        for between in (None, project)
    )  # fmt: skip
    assert_close(found[0], plain[0] * [0.5, 0.5, 1.0], 1e-12)
    assert found[1] == max(plain[1], gap, gap_v) and found[2] == max(plain[2], gap)


def test_the_estimate_of_the_implicit_method_shrinks_with_its_order() -> None:
    attempt = build_step(METHODS["implicit"], rhs(), 1, scale=SCALE)
    errors = [float(attempt([1.0, -0.5, 2.0], 1.0, [], h)[1]) for h in (2e-3, 1e-3)]
    assert abs(np.log2(errors[0] / errors[1]) - 4) < 0.5


def test_a_step_of_nan_is_not_accepted() -> None:
    """NaN anywhere must show, or a diverged step would look perfect."""
    attempt = build_step(METHODS["dopri5"], rhs(), 1, scale=SCALE)
    for i in range(3):
        x = np.ones(3)
        x[i] = np.nan
        assert np.isnan(float(attempt(x, 1.0, [], 1e-3)[1]))
