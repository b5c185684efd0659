# SPDX-License-Identifier: Apache-2.0
"""Computed torque: the error dynamics it promises, and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import models
from arm_dynamics import InvalidInput
from arm_dynamics.control import ComputedTorque, Measured
from arm_dynamics.trajectory import Reference, hold
from tolerances import INVERSE_PAIR, PINOCCHIO, assert_close


def test_without_error_it_is_inverse_dynamics(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q, v, a = models.random_state(rng, dyn.n)
    tau = ComputedTorque(dyn, 30.0).torque(Measured(q, v), Reference(q, v, a))
    assert_close(tau, dyn.inverse(q, v, a), PINOCCHIO)


def test_error_obeys_the_linear_equation(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    (q, v, a), (qd, vd, _) = (models.random_state(rng, dyn.n) for _ in range(2))
    omega, zeta = rng.uniform(5.0, 20.0, dyn.n), rng.uniform(0.5, 1.5, dyn.n)
    tau = ComputedTorque(dyn, omega, zeta).torque(Measured(q, v), Reference(qd, vd, a))
    acceleration = dyn.forward(q, v, tau)
    wanted = a + 2 * zeta * omega * (vd - v) + omega**2 * (qd - q)
    assert_close(acceleration, wanted, INVERSE_PAIR)


@pytest.mark.parametrize("zeta", [0.5, 1.0])
def test_error_decays_as_the_solution_of_that_equation(zeta: float) -> None:
    """Within what holding the torque for 1 ms costs: a delay of half a tick."""
    omega, sim = 10.0, models.simulator("two_link", integrator="rk4", dt=1e-3)
    goal = sim.state.q + [0.3, -0.2]
    control, reference = ComputedTorque(sim.dynamics, omega, zeta), hold(goal).sample(0.0)
    recording = sim.run(0.5, lambda state: control.torque(state, reference))
    t = recording.time
    if zeta == 1.0:
        shape = (1 + omega * t) * np.exp(-omega * t)
    else:
        damped = omega * np.sqrt(1 - zeta**2)
        shape = np.exp(-zeta * omega * t) * (
            np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t)
        )
    error = goal - recording.q
    np.testing.assert_allclose(error, shape[:, None] * error[0], rtol=0.0, atol=2e-3)


def test_zero_bandwidth_is_feed_forward_alone() -> None:
    dyn = models.dynamics("panda")
    q, far = np.zeros(dyn.n), np.ones(dyn.n)
    still = np.zeros(dyn.n)
    tau = ComputedTorque(dyn, 0.0).torque(Measured(q, still), Reference(far, far, still))
    assert_close(tau, dyn.gravity(q), PINOCCHIO)


@pytest.mark.parametrize(
    ("bandwidth", "damping_ratio", "complaint"),
    [
        (-1.0, 1.0, "bandwidth is -1"),
        (np.nan, 1.0, "bandwidth is nan"),
        (np.inf, 1.0, "bandwidth is inf"),
        ([1.0, 2.0], 1.0, r"bandwidth has shape \(2,\); allowed is a number or shape \(7,\)"),
        ([], 1.0, "bandwidth has shape"),
        (1.0, -0.1, "damping_ratio is -0.1"),
        (1.0, [[1.0]], "damping_ratio has shape"),
        ("fast", 1.0, "bandwidth is 'fast'"),
    ],
)
def test_bad_gains_are_refused(bandwidth: object, damping_ratio: object, complaint: str) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        ComputedTorque(models.dynamics("panda"), bandwidth, damping_ratio)
