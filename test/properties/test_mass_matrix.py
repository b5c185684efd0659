# SPDX-License-Identifier: Apache-2.0
"""M is symmetric and positive definite, and dM/dt - 2 C is skew-symmetric, at a thousand random
states of each robot.
"""

import numpy as np

import models
from tolerances import ALGEBRA, FINITE_DIFF, PINOCCHIO, assert_close

STATES = 1000


def test_symmetric_and_positive_definite(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    M = dyn.mass_matrix(rng.uniform(-np.pi, np.pi, (STATES, dyn.n)))
    assert_close(M, M.swapaxes(1, 2), PINOCCHIO)
    assert np.linalg.eigvalsh(M).min() > 0.0


def test_rate_of_M_minus_twice_C_is_skew(robot: str, rng: np.random.Generator) -> None:
    """dM/dt is the derivative of M along v, by a fourth-order central difference."""
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (STATES, dyn.n))
    v = rng.normal(size=(STATES, dyn.n))
    h = 1e-3

    def M(steps: int) -> np.ndarray:
        return np.asarray(dyn.mass_matrix(q + steps * h * v))

    rate = (8 * (M(1) - M(-1)) - (M(2) - M(-2))) / (12 * h)
    N = rate - 2 * dyn.coriolis_matrix(q, v)
    assert_close(N + N.swapaxes(1, 2), np.zeros_like(N), FINITE_DIFF)


def test_coriolis_does_no_work_of_its_own(robot: str, rng: np.random.Generator) -> None:
    """C is linear in v, and C(q, u) w = C(q, w) u: the Christoffel form."""
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (100, dyn.n))
    u, w = rng.normal(size=(2, 100, dyn.n))
    C = dyn.coriolis_matrix
    assert_close(C(q, 2 * u - w), 2 * C(q, u) - C(q, w), ALGEBRA)
    both = [np.einsum("kij,kj->ki", C(q, a), b) for a, b in ((u, w), (w, u))]
    assert_close(both[0], both[1], ALGEBRA)


def test_gravity_is_the_slope_of_potential_energy(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (50, dyn.n))
    still, h = np.zeros(dyn.n), 1e-3
    for i, e in enumerate(np.eye(dyn.n)):
        U = [dyn.energy(q + k * h * e, still)[1] for k in (-2, -1, 1, 2)]
        slope = (8 * (U[2] - U[1]) - (U[3] - U[0])) / (12 * h)
        assert_close(dyn.gravity(q)[:, i], slope, FINITE_DIFF)


def test_kinetic_energy_is_half_v_M_v(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q, v = rng.uniform(-np.pi, np.pi, (100, dyn.n)), rng.normal(size=(100, dyn.n))
    wanted = 0.5 * np.einsum("ki,kij,kj->k", v, dyn.mass_matrix(q), v)
    assert_close(dyn.energy(q, v)[0], wanted, PINOCCHIO)
