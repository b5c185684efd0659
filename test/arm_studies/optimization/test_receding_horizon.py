# SPDX-License-Identifier: Apache-2.0
"""The receding horizon in closed loops: as computed torque far from limits, better at them."""

from __future__ import annotations

import numpy as np
import pytest

from arm_dynamics import Dynamics, InvalidInput, load_scene
from arm_dynamics.control import ComputedTorque, Settings
from arm_dynamics.trajectory import Waypoint, hold
from arm_sim import ClosedLoop, Simulator
from arm_studies.optimization import RecedingHorizon


def scene(**joint: object) -> dict[str, object]:
    found = load_scene("two_link").model_dump(exclude_unset=True)
    return found | {"joints": {"*": {"limits": {"stop": False}} | joint}}


def test_far_from_limits_errors_fall_as_under_computed_torque() -> None:
    sim = Simulator(scene())
    dynamics, goal = sim.dynamics, sim.arm.x[:2] + 0.01
    made = {}
    for name, control in (
        ("ahead", RecedingHorizon(dynamics, bandwidth=15.0, horizon=0.4, nodes=40)),
        ("computed", ComputedTorque(dynamics, 15.0)),
    ):
        sim.reset()
        made[name] = sim.run(0.3, control, reference=hold(goal)).q
    assert abs(made["ahead"] - made["computed"]).max() < 0.05 * 0.01
    assert abs(made["ahead"][-1] - goal).max() < 0.1 * 0.01


def test_at_its_limits_the_arm_brakes_in_time() -> None:
    sim = Simulator(scene(), dt=5e-3)
    dynamics, goal = sim.dynamics, sim.arm.x[:2] + [1.2, 0.0]
    weight = abs(dynamics.gravity(np.linspace(-3, 3, 50)[:, None] * [1, 0])).max(axis=0)
    limit = 1.3 * weight + 0.1
    beyond = {}
    for name, control in (
        ("ahead", RecedingHorizon(dynamics, limit=limit, horizon=0.6, nodes=30)),
        ("computed", ComputedTorque(dynamics)),
    ):
        sim.reset()
        run = sim.run(2.0, lambda state, c=control: np.clip(
            c.torque(state, hold(goal).sample(0.0)), -limit, limit
        ))  # fmt: skip
        beyond[name] = run.q[:, 0].max() - goal[0]
        assert abs(run.tau).max() <= limit.max()
    assert beyond["ahead"] < 0.3 * beyond["computed"]
    assert abs(run.q[-1] - goal).max() < 0.2


def test_by_name_with_motors_that_take_currents() -> None:
    motor = {
        "command": "current",
        "torque_constant": 0.05,
        "gear_ratio": 50,
        "rotor_inertia": 1e-5,
    }
    pair = ClosedLoop(
        scene(actuator=motor, friction={"viscous": 0.2}),
        "arm_studies.optimization:RecedingHorizon", Settings(bandwidth=20.0, dt=4e-3), dt=4e-3,
    )  # fmt: skip
    goal = pair.simulator.arm.x[:2] + 0.4
    pair.follow([Waypoint(0.6, goal)])
    assert abs(pair.run(1.2).q[-1] - goal).max() < 1e-4


def test_it_begins_afresh() -> None:
    sim = Simulator(scene())
    control = RecedingHorizon(sim.dynamics)
    goal = hold(sim.arm.x[:2] + 0.3)
    first = sim.run(0.05, control, reference=goal).tau
    control.restart()
    sim.reset()
    np.testing.assert_array_equal(sim.run(0.05, control, reference=goal).tau, first)


def test_what_is_refused() -> None:
    with pytest.raises(InvalidInput, match="dry friction"):
        RecedingHorizon(Dynamics(scene(friction={"coulomb": 1.0})))
    with pytest.raises(InvalidInput, match=r"at least 0.71"):
        RecedingHorizon(Dynamics(scene()), damping_ratio=0.1)
    for gains in ({"bandwidth": [20.0, 0.0]}, {"damping_ratio": [1.0, 0.7]}):
        with pytest.raises(InvalidInput, match="allowed: numbers above 0, and of at least 0.71"):
            RecedingHorizon(Dynamics(scene()), **gains)
    RecedingHorizon(Dynamics(scene()), bandwidth=[20.0, 30.0], damping_ratio=[1.0, 0.71])
