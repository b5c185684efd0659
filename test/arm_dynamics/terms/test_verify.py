# SPDX-License-Identifier: Apache-2.0
"""The check of generated code accepts correct code and rejects wrong code."""

from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import Dynamics, KernelError, ModelError
from arm_dynamics.dynamics.checks import check_constrained, check_forward, closed_states, slack
from arm_dynamics.model.independent_rows import is_independent
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.terms.comparison import torque_size
from arm_dynamics.terms.verify import compare, random_states
from arm_sim import Simulator
from models import loops
from tolerances import CLOSURE, CLOSURE_SPEED, PINOCCHIO


def part(difference: Any, size: Any) -> tuple[np.ndarray, np.ndarray]:
    return np.array(difference, dtype=float), np.array(size, dtype=float)


def test_the_error_is_the_largest_difference_at_a_state_over_the_largest_size_there() -> None:
    first = part([[1e-12, -3e-12], [0.0, 0.0]], [[1.0, -2.0], [1.0, 1.0]])
    second = part([[[2e-12]], [[-4e-12]]], [[[10.0]], [[8.0]]])
    assert compare("code", first) == pytest.approx(1.5e-12, rel=1e-12, abs=0.0)
    assert compare("code", second) == pytest.approx(0.5e-12, rel=1e-12, abs=0.0)
    assert compare("code", first, second) == compare("code", second, first) == 1.5e-12


def test_code_may_be_off_by_rounding_only() -> None:
    assert compare("code", part([[1e-10]], [[1.0]])) == 1e-10
    with pytest.raises(KernelError) as caught:
        compare("code", part([[0.0]], [[1.0]]), part([[0.0], [-1.01e-10]], [[1.0], [1.0]]))
    assert str(caught.value) == (
        "generated code differs from Pinocchio by 1.01e-10 (relative); allowed: 1e-10"
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_a_number_is_off(bad: float) -> None:
    with pytest.raises(KernelError, match=f"by {abs(bad)}"):
        compare("code", part([[0.0], [bad]], [[1.0], [1.0]]))


def test_each_state_is_measured_by_itself() -> None:
    """A large value at one state does not hide an error at another, even where that is zero."""
    with pytest.raises(KernelError, match="by 5.00e-10"):
        compare("code", part([[0.0], [5e-10]], [[1e9], [1.0]]))
    with pytest.raises(KernelError):
        compare("code", part([[1e-300]], [[0.0]]))
    assert compare("code", part([[0.0]], [[0.0]])) == 0.0
    assert compare("code", part(np.zeros((2, 0)), np.zeros((2, 0)))) == 0.0


def test_the_size_of_a_torque_is_that_of_what_it_is_added_up_of() -> None:
    M = np.array([[[2.0, -1.0], [-1.0, 3.0]]])
    a, bias, tau = (np.array([row]) for row in ([1.0, -2.0], [-5.0, 0.5], [0.25, -4.0]))
    assert torque_size(M, a, bias, tau).tolist() == [[4.0 + 5.25, 7.0 + 4.5]]
    assert torque_size(M, a).tolist() == [[4.0, 7.0]]


def test_states_to_compare_at_are_always_the_same_and_all_round() -> None:
    states = random_states(3, 2)
    assert states.shape == (2, 20, 3)
    np.testing.assert_array_equal(states, random_states(3, 2))
    assert random_states(3).shape == (3, 20, 3)
    assert np.pi > states.max() > 2.5
    assert -np.pi < states.min() < -2.5


@pytest.fixture(scope="module", params=["two_link", "planar_3r"])
def dynamics(request: pytest.FixtureRequest) -> Dynamics:
    """Arms without dry friction, as in the generated code."""
    scene = models.scene(request.param)
    none = {"*": {"friction": {"viscous": 0.0, "coulomb": 0.0}}}
    return Dynamics({"robot": scene.robot.model_dump(), "joints": none})


def test_the_right_accelerations_pass(dynamics: Dynamics) -> None:
    assert check_forward(dynamics, dynamics.forward) < PINOCCHIO


@pytest.mark.parametrize("joint", [0, -1])
@pytest.mark.parametrize("which", ["q", "v", "tau", "a"])
def test_accelerations_of_another_state_do_not_pass(
    dynamics: Dynamics, which: str, joint: int
) -> None:
    """An error of 1e-6 in one entry, at the last of the states."""
    last = random_states(dynamics.n)[:, -1]

    def forward(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        given = {"q": q.copy(), "v": v.copy(), "tau": tau.copy()}
        off = 1e-6 * (q[0] == last[0][0])
        if which != "a":
            given[which][joint] += off
        a = dynamics.forward(**given)
        a[joint] += off * (which == "a")
        return a

    with pytest.raises(KernelError, match="forward dynamics differs from Pinocchio"):
        check_forward(dynamics, forward)


def test_a_joint_that_moves_no_mass_is_named() -> None:
    text = (models.FOLDER / "planar_3r.urdf").read_text()
    text = text.replace('<mass value="1.2"/>', '<mass value="0"/>').replace('"0.004"', '"0"')
    with pytest.raises(ModelError, match="joint3"):
        check_forward(Dynamics(text), lambda q, v, tau: np.full(3, np.inf))


def on_a_plane(*ties: dict[str, Any]) -> dict[str, Any]:
    """An arm whose tip is on a plane."""
    return {
        "robot": {"urdf": str(models.SCENES / "two_link.urdf")},
        "constraints": list(ties),
        "initial": {"position": {"shoulder": 0.4, "elbow": -0.9}},
    }


PLANE = {"type": "plane", "frames": ["tip", "world"]}
HELD = {
    "one tie": on_a_plane({**PLANE, "normal": [1, 0, 0]}),
    "one of two ties, which can go": on_a_plane(
        {**PLANE, "name": "a"}, {**PLANE, "name": "b", "switchable": True}
    ),
    "a chain of three four-bars": loops.chain(3),
    "two planes that are nearly one": loops.nearly_parallel(1e-4),
}


@pytest.fixture(scope="module", params=sampled(HELD.values(), 2), ids=HELD)
def tied(request: pytest.FixtureRequest) -> Dynamics:
    return Dynamics({**request.param, "joints": {"*": {"friction": {"viscous": 0.3}}}})


def rows_of(tied: Dynamics) -> tuple[Closure, list[bool]]:
    """A state that satisfies the constraints, and which of their rows are independent."""
    closure = tied.constrained.closure
    names, independent = closure.initially_active, tied.model.constraint_rows
    return closure, is_independent(closure.rows, names, independent)


def constrained(dyn: Dynamics, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    return dyn.constrained.forward(q, v, tau)[0]


def test_the_right_accelerations_under_constraints_pass(tied: Dynamics) -> None:
    assert check_constrained(tied, lambda *state: constrained(tied, *state)) < PINOCCHIO


@pytest.mark.parametrize("along", [True, False])
def test_accelerations_that_leave_the_constraint_or_lack_a_torque_do_not_pass(
    tied: Dynamics, *, along: bool
) -> None:
    """Off by 1e-6 in the direction that the constraint leaves free, or in the one that it bars."""

    closure, kept = rows_of(tied)

    def forward(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        A = closure.rows.stacked(q, v, closure.initially_active).jacobian[kept]
        off = np.linalg.svd(A)[2][-1] if along else A[0]
        return constrained(tied, q, v, tau) + 1e-6 * off / np.linalg.norm(off)

    with pytest.raises(KernelError, match="constrained dynamics differs from Pinocchio"):
        check_constrained(tied, forward)


@pytest.mark.parametrize("which", [0, 1, 2])
def test_accelerations_of_another_state_under_constraints_do_not_pass(
    tied: Dynamics, which: int
) -> None:
    def forward(*state: np.ndarray) -> np.ndarray:
        return constrained(tied, *(x + 1e-6 * (i == which) for i, x in enumerate(state)))

    with pytest.raises(KernelError, match="constrained dynamics differs from Pinocchio"):
        check_constrained(tied, forward)


def test_free_accelerations_do_not_pass_for_constrained_ones(tied: Dynamics) -> None:
    free = Dynamics(tied.model.scene.model_copy(update={"constraints": ()}))
    with pytest.raises(KernelError, match="constrained dynamics"):
        check_constrained(tied, free.forward)


def bias(dynamics: Dynamics, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Torques besides inertia: weight, Coriolis and viscous torques."""
    drag = dynamics.model.viscous
    return dynamics.coriolis_matrix(q, v) @ v + dynamics.gravity(q) + drag * v


def test_an_error_is_measured_by_the_torques_that_add_up(dynamics: Dynamics) -> None:
    off, shares = np.array([2e-10, -1e-10, 3e-10])[: dynamics.n], []
    for q, v, tau in zip(*random_states(dynamics.n), strict=True):
        M, a = dynamics.mass_matrix(q), dynamics.forward(q, v, tau)
        size = abs(M) @ abs(a) + abs(bias(dynamics, q, v)) + abs(tau)
        shares.append(abs(M @ off).max() / size.max())
    error = check_forward(dynamics, lambda *state: dynamics.forward(*state) + off)
    assert error == pytest.approx(max(shares), rel=1e-2, abs=0.0)


@pytest.mark.parametrize("along", [True, False])
def test_an_error_under_constraints_is_measured_by_what_adds_up(
    tied: Dynamics, *, along: bool
) -> None:
    """Errors that violate only the constraint, or only the equation of motion."""
    closure, kept = rows_of(tied)
    q, v, tau, condition = closed_states(closure, tied.model.q0, kept)
    for k in (0, len(q) - 1):
        row = closure.rows.stacked(q[k], v[k], closure.initially_active)
        A, drift, M = row.jacobian[kept], row.drift[kept], tied.mass_matrix(q[k])
        off = np.linalg.svd(A)[2][-1] if along else np.linalg.solve(M, A.T @ np.ones(len(A)))
        a, h = constrained(tied, q[k], v[k], tau[k]), bias(tied, q[k], v[k])
        free, reaction = np.linalg.solve(M, tau[k] - h), tau[k] - h - M @ a
        missing = M @ off - A.T @ np.linalg.lstsq(A.T, M @ off, rcond=None)[0]
        share = (
            abs(missing).max() / (abs(M) @ abs(a) + abs(tau[k]) + abs(reaction)).max()
            if along
            else abs(A @ off).max() / (abs(A) @ (abs(a) + abs(free)) + abs(drift)).max()
        )
        off *= 5e-11 * slack(condition[k]) / share
        error = check_constrained(
            tied,
            lambda *state, k=k, off=off: (
                constrained(tied, *state) + off * np.array_equal(state[1], v[k])
            ),
        )
        assert error == pytest.approx(5e-11, rel=2e-2)


def test_states_to_compare_at_are_closed_and_far_from_singular(tied: Dynamics) -> None:
    closure, kept = rows_of(tied)
    q, v, tau, condition = closed_states(closure, tied.model.q0, kept)
    assert q.shape == v.shape == tau.shape == (len(condition), tied.n)
    for qi, vi, of in zip(q, v, condition, strict=True):
        row = closure.rows.stacked(qi, vi, closure.initially_active)
        assert abs(row.residual).max() < CLOSURE
        assert abs(row.jacobian @ vi).max() < CLOSURE_SPEED * abs(vi).max()
        L = np.linalg.cholesky(tied.mass_matrix(qi))
        Y = np.linalg.solve(L, row.jacobian[kept].T)
        assert of == pytest.approx(np.linalg.cond(Y), rel=1e-6)
    assert abs(v).max() > 0.1
    again = closed_states(closure, tied.model.q0, kept)
    np.testing.assert_array_equal(q, again[0])


def test_a_long_chain_is_looked_at_where_it_is_closed() -> None:
    """Elsewhere its constraints are ten times as near to singular, and more with every loop."""
    dyn = Dynamics(loops.chain(4))
    closure, kept = rows_of(dyn)
    closed = closed_states(closure, dyn.model.q0, kept)[3].max()
    rows = [closure.rows.stacked(q, q, closure.initially_active) for q in random_states(dyn.n)[0]]
    L = [np.linalg.cholesky(dyn.mass_matrix(q)) for q in random_states(dyn.n)[0]]
    anywhere = [
        np.linalg.cond(np.linalg.solve(C, row.jacobian[kept].T))
        for C, row in zip(L, rows, strict=True)
    ]
    assert closed < 10.0 < 100.0 < max(anywhere)


def test_what_is_allowed_grows_with_the_condition_and_ends() -> None:
    rounding = np.finfo(float).eps / 1e-10
    given = np.array([1.0, 4e3, 1e5, 1e7, np.inf])
    assert slack(given).tolist() == [1.0, 1.0, 100 * rounding * 1e5, 1e3, 1e3]


def test_generated_code_of_constraints_that_are_nearly_one_passes() -> None:
    """Their error is rounding, and above the tolerance of well-conditioned constraints."""
    run = Simulator(loops.nearly_parallel(2e-5), backend="vm").run(0.01)
    assert abs(run.balance).max() < 1e-8
