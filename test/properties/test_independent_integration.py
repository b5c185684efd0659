# SPDX-License-Identifier: Apache-2.0
"""The whole chain at once: our motion against SciPy's integrator on Pinocchio's equations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import models
from tolerances import TRAJECTORY, assert_close

SECONDS = 0.2
# Robots without dry friction, whose equation of motion is smooth.
SMOOTH = [name for name in models.ROBOTS if not models.dynamics(name).model.has_dry_friction]


@pytest.mark.parametrize("name", SMOOTH)
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
