# SPDX-License-Identifier: Apache-2.0
"""Impedances chosen in units of force and torque rather than by a bandwidth."""

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import Settings, make_controller
from arm_dynamics.control.controller import Measured
from arm_dynamics.trajectory.reference import Reference

STIFF = np.array([600.0, 500.0, 400.0, 300.0, 50.0, 40.0, 30.0])
DAMPED = np.array([60.0, 50.0, 40.0, 30.0, 5.0, 4.0, 3.0])


def torque(name: str, q: np.ndarray, v: np.ndarray, **settings: object) -> np.ndarray:
    """Torque of the Panda's impedance at its start for a displacement and a speed."""
    dynamics = models.dynamics("panda")
    place, still = dynamics.model.q0, np.zeros(7)
    control = make_controller(name, dynamics, Settings(frame="panda_hand", **settings))  # type: ignore[arg-type]
    there = Reference(place, still, still)
    answer = control.torque(Measured(place + q, v), there)
    return np.asarray(answer - control.torque(Measured(place, still), there))


def test_joints_push_back_by_stiffness_and_damping(rng: np.random.Generator) -> None:
    """τ = K e + D ė in N m/rad and N m s/rad, beside what the motion itself takes."""
    q, still = 1e-7 * rng.normal(size=7), np.zeros(7)
    dynamics = models.dynamics("panda")
    place = dynamics.model.q0
    weight = dynamics.gravity(place + q) - dynamics.gravity(place)
    back = torque("joint_impedance", q, still, stiffness=STIFF, damping=DAMPED)
    np.testing.assert_allclose(back - weight, -STIFF * q, rtol=1e-5, atol=1e-9)
    v = 1e-7 * rng.normal(size=7)
    back = torque("joint_impedance", still, v, stiffness=STIFF, damping=DAMPED)
    np.testing.assert_allclose(back, -DAMPED * v, rtol=1e-5, atol=1e-12)


def test_a_damping_ratio_goes_with_a_stiffness(rng: np.random.Generator) -> None:
    """D = 2 ζ √(K M_ii), whatever the bandwidth."""
    v, still = 1e-7 * rng.normal(size=7), np.zeros(7)
    inertia = models.dynamics("panda").mass_matrix(models.dynamics("panda").model.q0).diagonal()
    for bandwidth in (5.0, 50.0):
        back = torque(
            "joint_impedance", still, v, stiffness=STIFF, damping_ratio=0.7, bandwidth=bandwidth
        )
        np.testing.assert_allclose(back, -1.4 * np.sqrt(STIFF * inertia) * v, rtol=1e-5)


def test_the_hand_pushes_back_in_newtons_per_metre(rng: np.random.Generator) -> None:
    """Twice the stiffness of an axis doubles its force and does not change the others."""
    q, still = 1e-6 * rng.normal(size=7), np.zeros(7)
    J = _jacobian()
    soft = np.array([400.0, 400.0, 0.0, 20.0, 20.0, 20.0])
    stiff = soft * [2.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    more, less = (
        torque("cartesian_impedance", q, still, stiffness=K, damping=5.0) for K in (stiff, soft)
    )
    np.testing.assert_allclose(more - less, J[0] * -400.0 * (J[0] @ q), rtol=1e-4, atol=1e-9)


def _jacobian() -> np.ndarray:
    from arm_dynamics.task_space import TaskSpace

    dynamics = models.dynamics("panda")
    return np.asarray(TaskSpace(dynamics, "panda_hand").jacobian(dynamics.model.q0))


@pytest.mark.parametrize("name", ["joint_impedance", "cartesian_impedance"])
@pytest.mark.parametrize(
    "wrong", [{"stiffness": -1.0}, {"stiffness": [1.0, 2.0]}, {"damping": -2.0}]
)
def test_what_cannot_be_is_refused(name: str, wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidInput, match=next(iter(wrong))):
        torque(name, np.zeros(7), np.zeros(7), **wrong)
