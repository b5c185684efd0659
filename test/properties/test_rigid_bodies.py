# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies at random states: against Pinocchio, and what mass matrices must be."""

import numpy as np
import pytest
from samples import sampled
from scipy.integrate import solve_ivp

import models
from tolerances import ALGEBRA, FINITE_DIFF, PINOCCHIO, TRAJECTORY, assert_close

STATES, SECONDS = 300, 0.2


def test_symmetric_and_positive_definite_and_its_rate_less_twice_C_is_skew(
    robot: str, rng: np.random.Generator
) -> None:
    """dM/dt is the derivative of M along v, by a fourth-order central difference."""
    dyn = models.dynamics(robot)
    q = rng.uniform(-np.pi, np.pi, (STATES, dyn.n))
    v = rng.normal(size=(STATES, dyn.n))
    h, mass = 1e-3, dyn.mass_matrix(q)
    assert_close(mass, mass.swapaxes(1, 2), PINOCCHIO)
    assert np.linalg.eigvalsh(mass).min() > 0.0
    wanted = 0.5 * np.einsum("ki,kij,kj->k", v, mass, v)
    assert_close(dyn.energy(q, v)[0], wanted, PINOCCHIO)

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


# Robots without dry friction, whose equation of motion is smooth.
SMOOTH = [name for name in models.ROBOTS if not models.dynamics(name).model.has_dry_friction]


@pytest.mark.parametrize("name", sampled(SMOOTH, 6))
def test_rk4_at_1_ms(name: str, rng: np.random.Generator) -> None:
    sim, oracle = models.simulator(name, stops=False, integrator="rk4"), models.oracle(name)
    q, v = rng.uniform(-1.0, 1.0, sim.n), 0.3 * rng.normal(size=sim.n)
    tau = sim.dynamics.inverse(q, v, rng.normal(size=sim.n))
    tau = tau.clip(-sim.model.effort_limit, sim.model.effort_limit)
    sim.reset(q, v)
    run = sim.run(SECONDS, tau)

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        return np.r_[x[sim.n :], oracle.forward(x[: sim.n], x[sim.n :], tau)]

    solved = solve_ivp(rate, (0.0, SECONDS), np.r_[q, v], "DOP853", rtol=1e-10, atol=1e-10)
    assert_close(np.r_[run.q[-1], run.v[-1]], solved.y[:, -1], TRAJECTORY)
