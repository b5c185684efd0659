# SPDX-License-Identifier: Apache-2.0
"""Commands in addition to gravity compensation, as Franka and UR accept them."""

import logging

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, Scene, load_scene
from arm_sim import ClosedLoop, JointCommand, Simulator


def compensated(name: str) -> Scene:
    """One of the robots, its commands gravity compensated."""
    data = models.scene(name).model_dump(exclude_unset=True, exclude_none=True)
    return load_scene({**data, "commands": {"gravity_compensated": True}})


@pytest.mark.parametrize("name", ["spring_balanced_arm", "motor_pendulum"])
def test_without_effort_the_arm_floats(name: str) -> None:
    sim = Simulator(compensated(name))
    recording = sim.run(0.3, np.zeros(sim.n))
    assert abs(recording.q - recording.q[0]).max() < 1e-6
    weight = models.dynamics(name).gravity(recording.q[0]) + models.dynamics(name).spring(
        recording.q[0]
    )
    np.testing.assert_allclose(sim.effort, weight, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_effort_is_added_to_the_weight_and_both_are_limited(
    sign: float, rng: np.random.Generator, caplog: pytest.LogCaptureFixture
) -> None:
    """Tick by tick the same as the plain arm under the sum."""
    sim = Simulator(compensated("two_link"), integrator="rk4")
    plain = models.simulator("two_link", integrator="rk4")
    caplog.set_level(logging.WARNING)
    for tau in 2.0 * rng.normal(size=(50, 2)):
        plain.step(tau + plain.dynamics.gravity(plain.state.q))
        sim.step(tau)
        np.testing.assert_allclose(sim.state.q, plain.state.q, rtol=1e-12, atol=1e-14)
    assert not caplog.records
    sim.step(np.full(2, sign * 1e3))
    np.testing.assert_array_equal(sim.effort, sign * sim.model.effort_limit)
    assert "is clipped" in caplog.text


def test_controllers_and_servos_leave_the_weight_out() -> None:
    """With the same arm in mind they do the same as with the plain one."""
    motions = []
    for scene in (models.scene("motor_pendulum"), compensated("motor_pendulum")):
        pair = ClosedLoop(scene)
        motions.append(pair.run(0.1).q)
        sim = Simulator(scene)
        led = sim.run(0.1, JointCommand(position=sim.state.q + 0.01))
        motions.append(led.q)
    np.testing.assert_allclose(motions[2], motions[0], atol=1e-9)
    np.testing.assert_allclose(motions[3], motions[1], atol=1e-9)


def test_a_command_that_holds_is_none() -> None:
    dynamics = Dynamics(compensated("panda"))
    q = dynamics.model.q0
    many = np.stack([q, q + 0.1])
    torques = dynamics.gravity(many) + 1.0
    np.testing.assert_allclose(dynamics.command_map(many, 0 * many, torques), 1.0, atol=1e-12)


def test_energy_rollouts_and_derivatives_know_of_it() -> None:
    sim, steps = Simulator(compensated("two_link")), 20
    q, v = sim.state.q, sim.state.v
    tau = np.array([1.0, -2.0])
    recording = sim.run(steps * sim.dt, tau)
    assert recording.energy_error < 1e-8
    last = sim.rollout(q[None], v[None], tau, steps, last_only=True)[0]
    np.testing.assert_allclose(last[:2], recording.q[-1], rtol=1e-10, atol=1e-12)
    sim.reset()
    A, _ = sim.linearize(sim.state, tau)
    shift = 1e-6
    ends = []
    for sign in (1, -1):
        moved = q.copy()
        moved[1] += sign * shift
        sim.reset(moved, v)
        ends.append(np.concatenate([sim.step(tau).q, sim.state.v]))
    np.testing.assert_allclose(A[:, 1], (ends[0] - ends[1]) / (2 * shift), atol=1e-5)
