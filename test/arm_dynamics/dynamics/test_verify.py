# SPDX-License-Identifier: Apache-2.0
"""The check that generated code passes: what is right goes through, and nothing that is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, KernelError, ModelError
from arm_dynamics.dynamics.verify import (
    check_constrained,
    check_forward,
    compare,
    random_states,
    torque_size,
)
from tolerances import PINOCCHIO


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
        "generated code differs from Pinocchio by 1.01e-10 (relative); 1e-10 is allowed"
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_a_number_is_off(bad: float) -> None:
    with pytest.raises(KernelError, match=f"by {abs(bad)}"):
        compare("code", part([[0.0], [bad]], [[1.0], [1.0]]))


def test_each_state_is_measured_by_itself() -> None:
    """A large size at one state hides nothing at another, even where the size is zero."""
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
    """Arms without dry friction, as generated code sees them."""
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
    """Off by 1e-6 in one entry at one of the states, the last one."""
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


def test_accelerations_that_are_no_numbers_do_not_pass(dynamics: Dynamics) -> None:
    def forward(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        return np.full(dynamics.n, np.nan)

    with pytest.raises(KernelError, match="forward dynamics differs from Pinocchio by nan"):
        check_forward(dynamics, forward)


def test_a_joint_that_moves_no_mass_is_named() -> None:
    text = (models.FOLDER / "planar_3r.urdf").read_text()
    text = text.replace('<mass value="1.2"/>', '<mass value="0"/>').replace('"0.004"', '"0"')
    with pytest.raises(ModelError, match="joint3"):
        check_forward(Dynamics(text), lambda q, v, tau: np.full(3, np.inf))


HELD = {
    "one tie": [{"type": "plane", "frames": ["tip", "world"], "normal": [1, 0, 0]}],
    "one of two ties, which can go": [
        {"type": "plane", "frames": ["tip", "world"], "name": "a"},
        {"type": "plane", "frames": ["tip", "world"], "name": "b", "switchable": True},
    ],
}


@pytest.fixture(scope="module", params=HELD.values(), ids=HELD)
def tied(request: pytest.FixtureRequest) -> Dynamics:
    """An arm whose tip is on a plane."""
    return Dynamics({
        "robot": {"urdf": str(models.SCENES / "two_link.urdf")},
        "constraints": request.param,
        "joints": {"*": {"friction": {"viscous": 0.3}}},
        "initial": {"position": {"shoulder": 0.4, "elbow": -0.9}},
    })  # fmt: skip


def constrained(dyn: Dynamics, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    return dyn.constrained.forward(q, v, tau)[0]


def test_the_right_accelerations_under_constraints_pass(tied: Dynamics) -> None:
    assert check_constrained(tied, lambda *state: constrained(tied, *state)) < PINOCCHIO


@pytest.mark.parametrize("along", [True, False])
def test_accelerations_that_leave_the_constraint_or_lack_a_torque_do_not_pass(
    tied: Dynamics, *, along: bool
) -> None:
    """Off by 1e-6 in the direction that the constraint leaves free, or in the one that it bars."""

    def forward(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        closure = tied.constrained.closure
        normal = closure.rows.stacked(q, v, closure.initially_active).jacobian[0]
        off = np.array([-normal[1], normal[0]]) if along else normal
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


def of_each_state(dynamics: Dynamics) -> list[tuple[np.ndarray, ...]]:
    """States, and what moves them against inertia: weight, Coriolis and viscous torques."""
    drag = dynamics.model.viscous
    return [
        (q, v, tau, dynamics.coriolis_matrix(q, v) @ v + dynamics.gravity(q) + drag * v)
        for q, v, tau in zip(*random_states(dynamics.n), strict=True)
    ]


def test_an_error_is_measured_by_the_torques_that_add_up(dynamics: Dynamics) -> None:
    off, shares = np.array([2e-10, -1e-10, 3e-10])[: dynamics.n], []
    for q, v, tau, h in of_each_state(dynamics):
        M, a = dynamics.mass_matrix(q), dynamics.forward(q, v, tau)
        size = abs(M) @ abs(a) + abs(h) + abs(tau)
        shares.append(abs(M @ off).max() / size.max())
    error = check_forward(dynamics, lambda *state: dynamics.forward(*state) + off)
    assert error == pytest.approx(max(shares), rel=1e-2, abs=0.0)


@pytest.mark.parametrize("along", [True, False])
def test_an_error_under_constraints_is_measured_by_what_adds_up(
    tied: Dynamics, *, along: bool
) -> None:
    """Off where only the constraint, or only the equation of motion, can see it."""
    rows, names = tied.constrained.closure.rows, tied.constrained.closure.initially_active

    def parts(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        row = rows.stacked(q, v, names)
        A, M = row.jacobian[0], tied.mass_matrix(q)
        off = np.array([-A[1], A[0]]) if along else np.linalg.solve(M, A)
        return A, 3e-11 * off / np.linalg.norm(off), float(row.drift[0])

    for q, v, tau, h in of_each_state(tied)[:6]:
        (A, off, drift), M = parts(q, v), tied.mass_matrix(q)
        a, free = constrained(tied, q, v, tau), np.linalg.solve(M, tau - h)
        reaction = tau - h - M @ a
        missing = abs(M @ off - A * (A @ M @ off) / (A @ A)).max()
        size = (abs(M) @ abs(a) + abs(tau) + abs(reaction)).max()
        share = (
            missing / size
            if along
            else abs(A @ off) / (abs(A) @ (abs(a) + abs(free)) + abs(drift))
        )
        error = check_constrained(
            tied,
            lambda *state, q=q, off=off: constrained(tied, *state) + off * (state[0][0] == q[0]),
        )
        assert error == pytest.approx(share, rel=1e-2, abs=0.0)
