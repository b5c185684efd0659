# SPDX-License-Identifier: Apache-2.0
"""The check of generated code accepts correct code and rejects wrong code."""

from typing import Any

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import Dynamics, KernelError, ModelError
from arm_dynamics.dynamics.checks import check_constrained, check_forward, closed_states
from arm_dynamics.model.loops.independent_rows import is_independent
from arm_dynamics.terms.verify import compare, random_states
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
    for off, said in ((-1.01e-10, "1.01e-10"), (np.nan, "nan"), (-np.inf, "inf")):
        with pytest.raises(KernelError, match=f"code differs from Pinocchio by {said}"):
            compare("code", part([[0.0]], [[1.0]]), part([[0.0], [off]], [[1.0], [1.0]]))

    with pytest.raises(KernelError, match="by 5.00e-10"):  # each state is measured by itself
        compare("code", part([[0.0], [5e-10]], [[1e9], [1.0]]))
    with pytest.raises(KernelError):
        compare("code", part([[1e-300]], [[0.0]]))
    assert compare("code", part([[0.0]], [[0.0]])) == 0.0


@pytest.fixture(scope="module")
def dynamics() -> Dynamics:
    """An arm without dry friction, as in the generated code."""
    scene = models.scene("planar_3r")
    none = {"*": {"friction": {"viscous": 0.0, "coulomb": 0.0}}}
    return Dynamics({"robot": scene.robot.model_dump(), "joints": none})


def test_the_right_accelerations_pass(dynamics: Dynamics) -> None:
    assert check_forward(dynamics, dynamics.forward) < PINOCCHIO


@pytest.mark.parametrize(("which", "joint"), [("q", -1), ("v", 0), ("tau", 0), ("a", -1)])
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
    "one of two ties, which can go": on_a_plane(
        {**PLANE, "name": "a"}, {**PLANE, "name": "b", "switchable": True}
    ),
    "a chain of three four-bars": loops.chain(3),
    "two planes that are nearly one": loops.nearly_parallel(1e-4),
}


@pytest.fixture(scope="module", params=sampled(HELD.values(), 2), ids=HELD)
def tied(request: pytest.FixtureRequest) -> Dynamics:
    return Dynamics({**request.param, "joints": {"*": {"friction": {"viscous": 0.3}}}})


def rows_of(tied: Dynamics) -> tuple[Any, tuple[str, ...], list[bool]]:
    """Constraints that are active at first, and which of their rows are independent."""
    rows, names = tied.constrained.closure.rows, tied.constrained.closure.initially_active
    return rows, names, is_independent(rows, names, tied.model.constraint_rows)


def test_states_to_compare_at_are_closed(tied: Dynamics) -> None:
    rows, names, kept = rows_of(tied)
    positions, velocities, *_ = closed_states(tied.constrained.closure, tied.model.q0, kept)
    for q, v in zip(positions, velocities, strict=True):
        row = rows.stacked(q, v, names)
        assert abs(row.residual).max() < CLOSURE
        assert abs(row.jacobian @ v).max() < CLOSURE_SPEED * abs(v).max()
    assert abs(velocities).max() > 0.1


def constrained(dyn: Dynamics, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    return dyn.constrained.forward(q, v, tau)[0]


def test_the_right_accelerations_under_constraints_pass(tied: Dynamics) -> None:
    assert check_constrained(tied, lambda *state: constrained(tied, *state)) < PINOCCHIO


@pytest.mark.parametrize("along", [True, False])
def test_accelerations_that_leave_the_constraint_or_lack_a_torque_do_not_pass(
    tied: Dynamics, *, along: bool
) -> None:
    """Off by 1e-6 in the direction that the constraint leaves free, or as its force pushes."""

    rows, names, kept = rows_of(tied)

    def forward(q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        A = rows.stacked(q, v, names).jacobian[kept]
        off = np.linalg.svd(A)[2][-1] if along else np.linalg.solve(tied.mass_matrix(q), A[0])
        return constrained(tied, q, v, tau) + 1e-6 * off / np.linalg.norm(off)

    with pytest.raises(KernelError, match="constrained dynamics differs from Pinocchio"):
        check_constrained(tied, forward)
