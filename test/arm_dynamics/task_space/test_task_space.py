# SPDX-License-Identifier: Apache-2.0
"""Task-space dynamics: identities on every robot, singularities, batches, refusals."""

import numpy as np
import pinocchio as pin
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.task_space.inertia import task_inertia
from tolerances import ALGEBRA, PINOCCHIO, assert_close

REFERENCES = ("local", "world", "local_world_aligned")
RATE = 1e-6  # J̇ against a central difference


def last_frame(name: str) -> str:
    frames = models.dynamics(name).model.pin.frames
    return next(f.name for f in reversed(list(frames)) if f.parentJoint > 0)


def task_of(name: str, reference: str = "local_world_aligned", selection: object = "pose"):
    return TaskSpace(models.dynamics(name), last_frame(name), reference, selection)


def regular_states(task: TaskSpace, rng: np.random.Generator, count: int = 5):
    """States whose answers are not damped."""
    found = 0
    for _ in range(200):
        q, v, _ = models.random_state(rng, task.n)
        if not task.terms(q, v).damped:
            yield q, v
            found += 1
        if found == count:
            return
    raise AssertionError("no regular states")


@pytest.mark.parametrize("reference", REFERENCES)
def test_jacobian_is_that_of_the_frame(robot: str, reference: str, rng) -> None:
    """Against the placement alone: a step of the joints moves the frame by J v; and its rate."""
    task = task_of(robot, reference)
    q, v, _ = models.random_state(rng, task.n)
    h = 1e-6
    ahead, behind, here = task.pose(q + h * v), task.pose(q - h * v), task.pose(q)
    R = here.rotation
    linear = (ahead.position - behind.position) / (2 * h)
    angular = pin.log3(ahead.rotation @ behind.rotation.T) / (2 * h)
    if reference == "local":
        linear, angular = R.T @ linear, R.T @ angular
    if reference == "world":
        linear = linear - np.cross(angular, here.position)
    np.testing.assert_allclose(
        task.jacobian(q) @ v, np.concatenate([linear, angular]), rtol=1e-6, atol=1e-7
    )
    difference = (task.jacobian(q + h * v) - task.jacobian(q - h * v)) / (2 * h)
    assert_close(task.jacobian_rate(q, v), difference, RATE)
    assert_close(task.bias(q, v), task.jacobian_rate(q, v) @ v, PINOCCHIO)


def test_equation_of_motion_of_the_hand(rng: np.random.Generator) -> None:
    """Λ ẍ + µ + p = f with ẍ from forward dynamics under τ = Jᵀ f, for a redundant arm too."""
    for name in ("panda", "ur10"):
        task, dyn = task_of(name), models.dynamics(name)
        for q, v in regular_states(task, rng):
            terms, f = task.terms(q, v), rng.normal(0, 20, 6)
            a = dyn.forward(q, v, terms.jacobian.T @ f + dyn.friction(v))
            x_dd = terms.jacobian @ a + terms.bias
            got = terms.inertia @ x_dd + terms.coriolis + terms.gravity
            scale = max(1.0, abs(terms.inertia).max() * abs(x_dd).max())
            np.testing.assert_allclose(got, f, rtol=0, atol=1e-11 * scale)


def test_null_space_neither_moves_nor_accelerates_the_hand(rng: np.random.Generator) -> None:
    task, dyn = task_of("panda"), models.dynamics("panda")
    for q, v in regular_states(task, rng):
        terms = task.terms(q, v)
        z = rng.normal(size=7)
        assert_close(terms.jacobian @ terms.inverse, np.eye(6), 1e-9)
        assert_close(terms.jacobian @ (terms.null_space @ z), np.zeros(6), 1e-9)
        pushed = np.linalg.solve(dyn.mass_matrix(q), terms.null_space.T @ z)
        assert_close(terms.jacobian @ pushed, np.zeros(6), 1e-8)
        assert np.linalg.norm(terms.null_space @ z) > 1e-3


@pytest.mark.parametrize("selection", ["position", "orientation", ("z", "rx", "x")])
def test_fewer_axes_are_rows_of_the_whole(selection: object, rng: np.random.Generator) -> None:
    whole, part = task_of("panda"), task_of("panda", selection=selection)
    q, v, _ = models.random_state(rng, 7)
    rows = [("x", "y", "z", "rx", "ry", "rz").index(axis) for axis in part.axes]
    assert rows == sorted(rows)
    a, b = whole.terms(q, v), part.terms(q, v)
    assert_close(b.jacobian, a.jacobian[rows], PINOCCHIO)
    assert_close(b.bias, a.bias[rows], PINOCCHIO)
    M = models.dynamics("panda").mass_matrix(q)
    J = a.jacobian[rows]
    assert_close(b.inertia, np.linalg.inv(J @ np.linalg.solve(M, J.T)), ALGEBRA)


def test_batches_are_rows(rng: np.random.Generator) -> None:
    task = task_of("kinova")
    q, v = rng.uniform(-2, 2, (4, task.n)), rng.normal(size=(4, task.n))
    batch = task.terms(q, v)
    for i in range(4):
        single = task.terms(q[i], v[i])
        for field in ("position", "rotation", "jacobian", "bias", "velocity"):
            assert_close(getattr(batch, field)[i], getattr(single, field), PINOCCHIO)
        for field in ("inertia", "coriolis", "gravity", "inverse", "null_space"):
            assert_close(getattr(batch, field)[i], getattr(single, field), 1e-9)
        assert batch.damped[i] == single.damped
    assert task.effective_mass(q, np.eye(6)[2]).mass.shape == (4,)
    with pytest.raises(ValueError, match="read-only"):
        batch.inertia[0, 0, 0] = 1.0


def test_effective_mass_is_force_per_acceleration(rng: np.random.Generator) -> None:
    task, dyn = task_of("panda", selection="position"), models.dynamics("panda")
    for q, _ in regular_states(task, rng):
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        J, still = task.jacobian(q), np.zeros(7)
        a = dyn.forward(q, still, J.T @ u + dyn.gravity(q))
        felt = task.effective_mass(q, 3.0 * u)
        np.testing.assert_allclose(felt.mass, 1.0 / (u @ J @ a), rtol=1e-9)
        ellipsoid = task.mass_ellipsoid(q)
        assert ellipsoid.masses[0] - 1e-9 <= felt.mass <= ellipsoid.masses[-1] + 1e-9
        principal = task.effective_mass(q, ellipsoid.axes[:, 1])
        np.testing.assert_allclose(principal.mass, ellipsoid.masses[1], rtol=1e-9)


def test_a_mass_is_bounded_by_the_mobility_of_its_own_kind() -> None:
    """Angular mobilities, some hundred times as large in SI units, bound no mass in kg."""
    q, dyn = [1.446, 0.37, -2.986, -0.95, -3.087, -1.2], models.dynamics("ur5e")
    felt = TaskSpace(dyn, "tool0", selection="position").effective_mass(q, [1, 0, 0])
    assert felt.mass == pytest.approx(106.9, rel=1e-3) and not felt.damped
    assert TaskSpace(dyn, "tool0").effective_mass(q, [1, 0, 0, 0, 0, 0]) == felt


def test_a_singular_state_is_flagged_and_finite() -> None:
    """Stretched out, two links cannot move along themselves, and the mass there is infinite."""
    task = task_of("two_link", selection=("x", "z"))
    for elbow in (0.0, 1e-12, 1e-6, 1e-3):
        terms = task.terms([0.3, elbow], [1.0, 2.0])
        assert terms.damped
        for value in vars(terms).values():
            assert not np.isnan(value).any()
        for field in ("inertia", "coriolis", "gravity", "inverse", "null_space"):
            assert np.isfinite(getattr(terms, field)).all()
        assert np.linalg.eigvalsh(terms.inertia)[0] > 0.0
    assert task.terms([0.3, 0.0]).condition == np.inf
    assert task.terms([0.3, 0.0]).manipulability < 1e-12
    along = np.array([np.cos(0.3), np.sin(0.3)])
    felt = task.effective_mass([0.3, 0.0], along)
    assert felt.damped and np.isfinite(felt.mass) and felt.mass > 1e3
    assert not task.effective_mass([0.3, 0.0], [-along[1], along[0]]).damped


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("nowhere",), "frame 'nowhere' does not exist; allowed: "),
        (("universe",), "frame 'universe' does not move"),
        (("tip", "sideways"), "reference = 'sideways'; allowed: local, world"),
        (("tip", "local", ("x", "x")), "selection = "),
        (("tip", "local", "pose", 0.0), "threshold = 0.0"),
    ],
)
def test_bad_tasks_are_refused(arguments: tuple[object, ...], complaint: str) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        TaskSpace(models.dynamics("two_link"), *arguments)  # type: ignore[arg-type]


def test_bad_vectors_are_refused() -> None:
    task = task_of("two_link", selection=("x", "z"))
    with pytest.raises(InvalidInput, match=r"v\[1\] = nan"):
        task.bias([0.0, 1.0], [0.0, np.nan])
    with pytest.raises(InvalidInput, match="batches must have the same length"):
        task.terms(np.zeros((2, 2)), np.zeros((3, 2)))
    with pytest.raises(InvalidInput, match="direction"):
        task.effective_mass([0.0, 1.0], [0.0, 0.0])
    with pytest.raises(InvalidInput, match="mixes kg and kg m²"):
        task_of("panda").mass_ellipsoid(np.zeros(7))


THRESHOLD = 0.1


def mobility(least: float) -> np.ndarray:
    """Of two linear axes whose scaled mobility is ``least`` and two less that, with units."""
    turned = np.array([[0.8, -0.6], [0.6, 0.8]])
    return np.asarray(9.0 * turned @ np.diag([least, 2.0 - least]) @ turned.T)


@pytest.mark.parametrize("least", [0.0, 0.01, 0.0999, 0.1, 0.3])
def test_damping_grows_with_the_square_of_what_is_lacking(least: float) -> None:
    """Λ = (A + δ S²)⁻¹ with δ = ε (1 - σ/ε)² below the threshold, A⁻¹ above."""
    A = mobility(least)
    found = task_inertia(A, 2, THRESHOLD)
    damping = THRESHOLD * max(1.0 - least / THRESHOLD, 0.0) ** 2
    assert_close(found.matrix, np.linalg.inv(A + 9.0 * damping * np.eye(2)), ALGEBRA)
    assert_close(found.least, least, ALGEBRA)
    if abs(least - THRESHOLD) > 1e-6:
        assert found.damped == (least < THRESHOLD)
