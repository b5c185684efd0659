# SPDX-License-Identifier: Apache-2.0
"""The numeric dynamics of a simulator contain everything that is tunable, as it is now."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, Term
from arm_sim import Simulator
from tolerances import PINOCCHIO, assert_close

PUSH = np.array([2.0, -1.0])
LOAD = [0.8, 0.1, 0.0, 0.02, 2e-3, 0.0, 0.0, 3e-3, 0.0, 2e-3]
RAIL = {"type": "plane", "frames": ["tip", "world"], "height": -0.3, "switchable": True}
LOSSY = {"actuator": {"efficiency": 0.8}, "friction": {"viscous": 0.2, "coulomb": 0.4}}


def scene(**more: Any) -> dict[str, Any]:
    dry = ["coulomb"] if more.get("joints") else []
    return {
        "robot": models.scene("two_link").robot.model_dump(),
        "payloads": [{"frame": "tip", "mass": 0.1}],
        "initial": {"position": {"shoulder": 0.3, "elbow": 0.1}},
        "tunable": ["gravity", "payload", "friction", "external", *dry],
        **more,
    }


def tune(sim: Simulator) -> None:
    sim.set_parameter("gravity", [0.5, 0.0, -3.0])
    sim.set_parameter("payload", LOAD)
    sim.set_parameter("friction", [0.7, 0.1])
    sim.set_parameter("external", PUSH)
    if "coulomb" in sim.arm.plant.parameters.names:
        sim.set_parameter("coulomb", [0.9, 0.2])


@pytest.mark.parametrize("joints", [{}, {"*": LOSSY}], ids=["smooth", "lossy"])
def test_forward_dynamics_are_those_of_the_next_tick(joints: dict[str, Any]) -> None:
    sim = Simulator(scene(joints=joints, initial={"velocity": {"shoulder": 0.5, "elbow": -0.7}}))
    tune(sim)
    tau, h = np.array([1.0, 0.5]), sim.dt
    before = sim.state
    predicted = sim.dynamics.forward(before.q, before.v, tau)
    after = sim.step(tau)
    later = sim.dynamics.forward(after.q, after.v, tau)
    np.testing.assert_allclose((after.v - before.v) / h, (predicted + later) / 2, atol=1e-4)
    assert abs(predicted - Dynamics(sim.model).forward(before.q, before.v, tau)).min() > 0.1


def test_external_torques_are_in_the_sum_of_all_terms_only() -> None:
    sim = Simulator(scene(), backend="vm")
    plain, state = sim.dynamics, np.array([[0.3, 0.1], [0.5, -0.2], [1.0, 2.0]])
    sim.set_parameter("external", PUSH)
    assert_close(sim.dynamics.inverse(*state), plain.inverse(*state) - PUSH, PINOCCHIO)
    for terms in (Term.ALL & ~Term.SPRING, Term.GRAVITY, Term.INERTIA | Term.FRICTION):
        own, expected = (arm.inverse(*state, terms=terms) for arm in (sim.dynamics, plain))
        np.testing.assert_array_equal(own, expected)
    np.testing.assert_array_equal(sim.dynamics.gravity(state[0]), plain.gravity(state[0]))


def test_static_friction_bears_external_torques() -> None:
    sim = Simulator(scene(gravity=[0, 0, 0], joints={"*": {"friction": {"coulomb": 3.0}}}))
    still = np.zeros(2)
    sim.set_parameter("external", PUSH)
    np.testing.assert_array_equal(sim.dynamics.forward(still, still, still), still)
    sim.set_parameter("external", 2 * PUSH)
    assert sim.dynamics.forward(still, still, still)[0] > 0.0


def test_the_constraints_are_those_that_are_active() -> None:
    sim = Simulator(scene(constraints=[RAIL]), backend="vm")
    q, v, tau = sim.state.q, sim.state.v, np.array([0.3, 0.2])
    sim.set_parameter("external", PUSH)
    held = sim.dynamics.forward(q, v, tau)
    assert_close(held, Dynamics(sim.model).forward(q, v, tau + PUSH), PINOCCHIO)
    a, lam = sim.dynamics.constrained_forward(q, v, tau)
    assert_close(a, held, PINOCCHIO)
    assert_close(sim.dynamics.constrained_inverse(q, v, a, lam), tau, 1e-9)
    sim.set_constraint("plane_0", on=False)
    free = Dynamics(scene())
    assert_close(sim.dynamics.forward(q, v, tau), free.forward(q, v, tau + PUSH), 1e-9)
    assert not sim.dynamics.constrained_forward(q, v, tau)[1].any()
    both = sim.dynamics.constrained_forward(q, v, tau, active=["plane_0"])[0]
    assert_close(both, held, PINOCCHIO)
