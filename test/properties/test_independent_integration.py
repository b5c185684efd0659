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


def test_panda_falls_freely_for_a_second() -> None:
    """Its wrist reaches 40 rad/s; RK4 at 1 ms stays within 5e-6 rad, error control within what it
    is asked for.
    """
    truth = models.simulator("panda_free", tolerance=1e-13).run(1.0).q[-1]
    fixed = models.simulator("panda_free", integrator="rk4").run(1.0).q[-1]
    controlled = models.simulator("panda_free", tolerance=1e-9).run(1.0).q[-1]
    assert np.abs(fixed - truth).max() < 5e-6
    assert np.abs(controlled - truth).max() < 1e-8
