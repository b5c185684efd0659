# SPDX-License-Identifier: Apache-2.0
"""The planar arm of two point masses, written out in the frame of its second link.

Craig, Introduction to Robotics, example 6.6, derived again; rates are those of the components
along the moving axes.
"""

import numpy as np
import pytest

from arm_dynamics import Dynamics
from arm_dynamics.task_space import TaskSpace
from models.two_bodies import two_bodies
from tolerances import ALGEBRA, assert_close

M1, M2, L1, L2, G = 2.0, 1.5, 0.7, 0.4, 9.81


@pytest.fixture(scope="module")
def task() -> TaskSpace:
    arm = Dynamics(two_bodies(L1, (M1, M2), (L1, L2)))
    return TaskSpace(arm, "tip", "local", ("x", "z"))


@pytest.fixture
def states(rng: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    elbows = rng.uniform(0.3, 2.8, 20) * rng.choice([-1, 1], 20)
    return [(np.array([rng.uniform(-3, 3), e]), rng.normal(size=2)) for e in elbows]


def test_jacobian_and_its_rate(task: TaskSpace, states: list) -> None:
    for q, v in states:
        s2, c2 = np.sin(q[1]), np.cos(q[1])
        assert_close(task.jacobian(q), [[L1 * s2, 0], [L1 * c2 + L2, L2]], ALGEBRA)
        rate = [[L1 * c2 * v[1], 0], [-L1 * s2 * v[1], 0]]
        assert_close(task.jacobian_rate(q, v), rate, ALGEBRA)


def test_rates_of_the_components_are_no_acceleration(task: TaskSpace, states: list) -> None:
    """J θ̈ + J̇ θ̇ lacks ω × ẋ, since the axes turn with the second link."""
    fixed = TaskSpace(task.model, "tip", "local_world_aligned", ("x", "z"))
    for q, v in states:
        c12, s12 = np.cos(q.sum()), np.sin(q.sum())
        acceleration = np.array([[c12, s12], [-s12, c12]]) @ (fixed.jacobian_rate(q, v) @ v)
        x, y = task.jacobian(q) @ v
        turning = v.sum() * np.array([-y, x])
        assert_close(task.jacobian_rate(q, v) @ v + turning, acceleration, ALGEBRA)


def test_inertia_is_diagonal(task: TaskSpace, states: list) -> None:
    for q, _ in states:
        wanted = np.diag([M2 + M1 / np.sin(q[1]) ** 2, M2])
        assert_close(task.terms(q).inertia, wanted, ALGEBRA)


def test_velocity_terms(task: TaskSpace, states: list) -> None:
    for q, v in states:
        s2, c2 = np.sin(q[1]), np.cos(q[1])
        along = (
            -(M2 * L1 * c2 + M2 * L2) * v[0] ** 2
            - M2 * L2 * v[1] ** 2
            - (2 * M2 * L2 + M2 * L1 * c2 + M1 * L1 * c2 / s2**2) * v[0] * v[1]
        )
        across = M2 * L1 * s2 * v[0] ** 2 + M2 * L1 * s2 * v[0] * v[1]
        assert_close(task.terms(q, v).coriolis, [along, across], ALGEBRA)


def test_gravity_terms(task: TaskSpace, states: list) -> None:
    for q, _ in states:
        s2, c1 = np.sin(q[1]), np.cos(q[0])
        far = q[0] + q[1]
        wanted = [M1 * G * c1 / s2 + M2 * G * np.sin(far), M2 * G * np.cos(far)]
        assert_close(task.terms(q).gravity, wanted, ALGEBRA)
