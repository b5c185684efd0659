# SPDX-License-Identifier: Apache-2.0
"""Which bodies there can be, and the best of them where the best fit is none."""

import numpy as np
import pytest

from arm_dynamics import ArmModel, load_scene
from arm_studies.identification.regression import bodies
from arm_studies.identification.regression.base_parameters import base_parameters
from arm_studies.identification.regression.estimation import Prior, consistent_solution
from arm_studies.identification.regression.regressor import RigidRegressor

BALL = bodies.inertial_parameters(np.diag([0.01, 0.01, 0.01, 2.0]))


def test_numbers_and_pseudo_inertia_are_each_others_inverse():
    numbers = np.array([2.0, 0.1, -0.2, 0.3, 0.5, 0.01, 0.6, 0.02, 0.03, 0.7])
    np.testing.assert_allclose(bodies.inertial_parameters(bodies.pseudo_inertia(numbers)), numbers)


def test_bodies_are_distinguished_from_impossible_ones():
    assert bodies.consistent(BALL)
    rod_too_fat = BALL.copy()
    rod_too_fat[9] = 0.1  # more about one axis than about the other two together
    assert not bodies.consistent(rod_too_fat)
    far = BALL.copy()
    far[1] = 1.0  # a centre of mass beyond what the moments allow
    assert not bodies.consistent(far)
    np.testing.assert_array_equal(bodies.nearest(BALL), BALL)
    plate = bodies.inertial_parameters(np.diag([0.01, 0.01, 0.0, 2.0]))
    assert bodies.consistent(bodies.nearest(plate)) and not bodies.consistent(plate)


def test_a_plate_of_less_density_is_believed_to_be_a_body():
    """One that a description has too thin, too: it has no direction to shrink in."""
    plate = bodies.inertial_parameters(np.diag([0.01, 0.01, 1e-7, 2.0]))
    belief = Prior.near(plate, 0.1, 1e-4)
    lighter = 0.8 * belief.x0
    assert bodies.consistent(lighter)
    assert np.linalg.norm(belief.rows @ (lighter - belief.x0)) == pytest.approx(2.0, 1e-3)
    np.testing.assert_allclose(belief.x0, plate, atol=1e-4)


def test_the_best_possible_body_is_found():
    """Against the nearest positive semidefinite matrix, known in closed form."""
    wanted = bodies.pseudo_inertia(BALL).copy()
    wanted[2, 2] = -0.02
    gram = np.einsum("kab,lab->kl", bodies.BASIS, bodies.BASIS)
    R = np.linalg.cholesky(gram).T  # so that ‖R x‖ is Frobenius' norm of J
    found = consistent_solution(R, R @ bodies.inertial_parameters(wanted), BALL, BALL, ())
    best = np.diag([0.01, 0.01, 0.0, 2.0])
    np.testing.assert_allclose(bodies.pseudo_inertia(found), best, atol=1e-4)
    assert bodies.consistent(found)


def test_as_many_base_parameters_as_are_known_of_six_joints():
    """Gautier and Khalil 1990."""
    regressor = RigidRegressor(ArmModel(load_scene("ur10")))
    names = [f"number {k}" for k in range(len(regressor.nominal))]
    base = base_parameters(regressor, regressor.model.n, names)
    assert len(base.independent) == 36
    rng = np.random.default_rng(5)
    state = rng.uniform(-2.0, 2.0, (3, 20, regressor.model.n))
    Y, theta = regressor(*state), rng.normal(size=len(regressor.nominal))
    np.testing.assert_allclose(
        Y[:, :, list(base.independent)] @ base.of(theta), Y @ theta, atol=1e-6 * abs(Y).max()
    )
