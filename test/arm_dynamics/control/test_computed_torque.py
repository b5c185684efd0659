# SPDX-License-Identifier: Apache-2.0
"""Computed torque: its error dynamics, and refusals."""

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, InvalidInput, Term
from arm_dynamics.control import ComputedTorque, Measured, held_gains
from arm_dynamics.trajectory import Reference, hold
from models.rotor import rotor
from tolerances import ALGEBRA, INVERSE_PAIR, LINEAR_ERROR, PINOCCHIO, assert_close


def test_error_obeys_the_linear_equation(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    (q, v, a), (qd, vd, _) = (models.random_state(rng, dyn.n) for _ in range(2))
    omega, zeta = rng.uniform(5.0, 20.0, dyn.n), rng.uniform(0.5, 1.5, dyn.n)
    tau = ComputedTorque(dyn, omega, zeta, dt=0.0).torque(Measured(q, v), Reference(qd, vd, a))
    acceleration = dyn.forward(q, v, tau)
    wanted = a + 2 * zeta * omega * (vd - v) + omega**2 * (qd - q)
    assert_close(acceleration, wanted, INVERSE_PAIR)


def test_a_held_torque_is_that_of_the_middle_of_its_tick(
    robot: str, rng: np.random.Generator
) -> None:
    """Without error: inverse dynamics half a tick on, friction in the direction of now."""
    dyn, dt = models.dynamics(robot), 2e-3
    q, v, a = models.random_state(rng, dyn.n)
    tau = ComputedTorque(dyn, 30.0, dt=dt).torque(Measured(q, v), Reference(q, v, a))
    later = v + dt / 2 * a
    rigid = Term.INERTIA | Term.CORIOLIS | Term.GRAVITY
    wanted = dyn.inverse(q + dt / 2 * v, later, a, rigid) + dyn.friction(later, direction=v)
    assert_close(tau, wanted, PINOCCHIO)


@pytest.mark.parametrize("zeta", [0.5, 1.5])
def test_error_falls_as_the_linear_equation_says(zeta: float) -> None:
    """At 1 kHz, the torque held between the ticks: ë + 2 ζ ω ė + ω² e = 0 from e = 1, ė = 0."""
    sim, omega = models.simulator("panda", integrator="rk4", dt=1e-3), 30.0
    step = 1.5 / omega**2  # [rad], so that no torque limit is met
    goal = sim.state.q + np.resize([step, -0.7 * step], sim.dynamics.n)
    control, reference = ComputedTorque(sim.dynamics, omega, zeta), hold(goal).sample(0.0)
    recording = sim.run(0.3, lambda state: control.torque(state, reference))
    error = goal - recording.q
    slow, fast = np.roots([1.0, 2 * zeta * omega, omega**2]).astype(complex)
    rise = np.exp(np.outer([slow, fast], recording.time))
    shape = ((slow * rise[1] - fast * rise[0]) / (slow - fast)).real
    np.testing.assert_allclose(error / error[0], np.outer(shape, np.ones(sim.dynamics.n)),
                               rtol=0.0, atol=LINEAR_ERROR)  # fmt: skip


@pytest.mark.parametrize("way", [1.0, 0.0, -1.0])
def test_a_joint_at_rest_is_helped_the_way_it_is_to_go(way: float) -> None:
    dyn, still = Dynamics(rotor(0.1, coulomb=0.5)), np.zeros(1)
    goal = Reference(still, np.array([way]), still)
    tau = ComputedTorque(dyn, 0.0, dt=0.0).torque(Measured(still, still), goal)
    assert_close(tau, [0.5 * way], PINOCCHIO)


@pytest.mark.parametrize("zeta", [0.0, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("dt", [1e-5, 0.1])
def test_held_gains_place_the_poles_of_the_sampled_loop(zeta: float, dt: float) -> None:
    omega = np.array([0.1, 7.0, 300.0])
    for kp, kd, w in zip(*held_gains(omega, zeta, 3, dt), omega, strict=True):
        drift, pushed = np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt**2 / 2, dt])
        held = drift - np.outer(pushed, [kp, kd])
        root = w * np.sqrt(complex(zeta**2 - 1))
        wanted = np.exp(np.array([-zeta * w + root, -zeta * w - root]) * dt)
        assert_close(np.trace(held), wanted.sum().real, ALGEBRA)
        assert_close(np.linalg.det(held), wanted.prod().real, ALGEBRA)


@pytest.mark.parametrize(
    ("gains", "complaint"),
    [
        ((-1.0, 1.0), "bandwidth is -1"),
        (([1.0, 2.0], 1.0), r"bandwidth has shape \(2,\)"),
        (([20.0] * 6 + [1.1e6], 1.0), r"bandwidth is .*; allowed: at most 1e\+06 rad/s"),
        ((1.0, -0.1), "damping_ratio is -0.1"),
    ],
)
def test_bad_gains_are_refused(gains: tuple[object, object], complaint: str) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        ComputedTorque(models.dynamics("panda"), *gains)
