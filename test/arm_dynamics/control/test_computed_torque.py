# SPDX-License-Identifier: Apache-2.0
"""Computed torque: its error dynamics, and refusals."""

from itertools import product

import numpy as np
import pytest
from samples import sampled

import models
from arm_dynamics import InvalidInput, Term
from arm_dynamics.control import ComputedTorque, Measured, gains, held_gains
from arm_dynamics.trajectory import Reference, hold
from tolerances import ALGEBRA, INVERSE_PAIR, LINEAR_ERROR, PINOCCHIO, assert_close


def test_without_error_it_is_inverse_dynamics(robot: str, rng: np.random.Generator) -> None:
    dyn = models.dynamics(robot)
    q, v, a = models.random_state(rng, dyn.n)
    tau = ComputedTorque(dyn, 30.0, dt=0.0).torque(Measured(q, v), Reference(q, v, a))
    assert_close(tau, dyn.inverse(q, v, a), PINOCCHIO)


def test_a_state_in_single_precision_is_taken_as_the_numbers_it_holds(robot: str) -> None:
    dyn = models.dynamics(robot)
    control, at = ComputedTorque(dyn, 30.0), hold(np.zeros(dyn.n)).sample(0.0)
    q = v = np.linspace(0.1, 0.7, dyn.n, dtype=np.float32)
    wanted = control.torque(Measured(q.astype(float), v.astype(float)), at)
    tau = control.torque(Measured(q, v), at)
    assert tau.dtype == np.float64
    assert tau.tolist() == wanted.tolist()


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


@pytest.mark.parametrize(
    ("robot_name", "omega", "zeta"),
    sampled(product(["two_link", "panda"], [5.0, 10.0, 30.0], [0.5, 1.0, 1.5]), 5),
)
def test_error_falls_as_the_linear_equation_says(
    robot_name: str, omega: float, zeta: float
) -> None:
    """At 1 kHz, the torque held between the ticks."""
    sim = models.simulator(robot_name, integrator="rk4", dt=1e-3)
    step = 1.5 / omega**2  # [rad], so that no torque limit is met
    goal = sim.state.q + np.resize([step, -0.7 * step], sim.dynamics.n)
    control, reference = ComputedTorque(sim.dynamics, omega, zeta), hold(goal).sample(0.0)
    recording = sim.run(0.5, lambda state: control.torque(state, reference))
    error = goal - recording.q
    shape = _response(recording.time, omega, zeta)
    np.testing.assert_allclose(error / error[0], np.outer(shape, np.ones(sim.dynamics.n)),
                               rtol=0.0, atol=LINEAR_ERROR)  # fmt: skip


def _response(t: np.ndarray, omega: float, zeta: float) -> np.ndarray:
    """Solution of ë + 2 ζ ω ė + ω² e = 0 from e = 1, ė = 0."""
    if zeta == 1.0:
        return (1 + omega * t) * np.exp(-omega * t)
    root = omega * np.sqrt(complex(zeta**2 - 1))
    fast, slow = -zeta * omega - root, -zeta * omega + root
    return ((slow * np.exp(fast * t) - fast * np.exp(slow * t)) / (slow - fast)).real


@pytest.mark.parametrize("zeta", [0.0, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("dt", [1e-5, 1e-3, 0.1])
def test_held_gains_place_the_poles_of_the_sampled_loop(zeta: float, dt: float) -> None:
    omega = np.array([0.1, 7.0, 300.0])
    for kp, kd, w in zip(*held_gains(omega, zeta, 3, dt), omega, strict=True):
        drift, pushed = np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt**2 / 2, dt])
        held = drift - np.outer(pushed, [kp, kd])
        root = w * np.sqrt(complex(zeta**2 - 1))
        wanted = np.exp(np.array([-zeta * w + root, -zeta * w - root]) * dt)
        assert_close(np.trace(held), wanted.sum().real, ALGEBRA)
        assert_close(np.linalg.det(held), wanted.prod().real, ALGEBRA)


def test_held_gains_of_no_time_are_those_of_the_books() -> None:
    assert_close(held_gains([5.0, 0.0], 0.7, 2, 0.0), gains([5.0, 0.0], 0.7, 2), ALGEBRA)
    near = np.array(held_gains([5.0, 0.0], 0.7, 2, 1e-7))
    np.testing.assert_allclose(near, gains([5.0, 0.0], 0.7, 2), rtol=1e-5)


def test_a_bandwidth_beyond_the_tick_is_still_stable() -> None:
    """Where the textbook gains are unstable: ω dt = 4."""
    sim = models.simulator("two_link", integrator="rk4", dt=1e-3)
    goal = sim.state.q + 1e-5
    control, reference = ComputedTorque(sim.dynamics, 4000.0), hold(goal).sample(0.0)
    recording = sim.run(0.05, lambda state: control.torque(state, reference))
    assert abs(goal - recording.q[-1]).max() < 1e-8


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
        ([1.0, 2.0], 1.0, r"bandwidth has shape \(2,\); allowed: a number or shape \(7,\)"),
        (1.0, -0.1, "damping_ratio is -0.1"),
        ("fast", 1.0, "bandwidth = 'fast'"),
    ],
)
def test_bad_gains_are_refused(bandwidth: object, damping_ratio: object, complaint: str) -> None:
    with pytest.raises(InvalidInput, match=complaint):
        ComputedTorque(models.dynamics("panda"), bandwidth, damping_ratio)


def test_no_joint_is_faster_than_any_torque() -> None:
    gains([20.0, 1e6], 1.0, 2)
    for bandwidth in ([20.0, 1.1e6], [1.1e6, 20.0]):
        with pytest.raises(InvalidInput, match=r"bandwidth is .*; allowed: at most 1e\+06 rad/s"):
            gains(bandwidth, 1.0, 2)
