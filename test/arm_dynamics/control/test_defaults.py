# SPDX-License-Identifier: Apache-2.0
"""Controllers without parameters use the defaults that are documented."""

import numpy as np
import pytest

import models
from arm_dynamics.control import (
    CartesianImpedance,
    ComputedTorque,
    Controller,
    DisturbanceObserver,
    JointImpedance,
    Measured,
    MotionForce,
    OperationalSpace,
    Switch,
)
from arm_dynamics.task_space import TaskSpace
from arm_dynamics.trajectory import Reference, TaskReference


@pytest.mark.parametrize(
    ("law", "own", "default"),
    [
        (CartesianImpedance, (300.0,), {"damping_ratio": 0.7, "posture_bandwidth": 4.0}),
        (
            OperationalSpace,
            (),
            {"bandwidth": 20.0, "damping_ratio": 1.0, "posture_bandwidth": 4.0},
        ),
        (MotionForce, ([0, 0, 1],), {"bandwidth": 20.0, "damping_ratio": 1.0}),
    ],
)
def test_task_space(law: type, own: tuple, default: dict, rng: np.random.Generator) -> None:
    task = TaskSpace(models.dynamics("panda"), "panda_hand")
    state = Measured(rng.uniform(-1.0, 1.0, 7), rng.uniform(-1.0, 1.0, 7))
    pose, still = task.pose(state.q), np.zeros(6)
    goal = TaskReference(pose.position + 0.1, pose.rotation, still, still, 5.0)
    plain, said = law(task, *own), law(task, *own, **default)
    np.testing.assert_array_equal(plain.torque(state, goal), said.torque(state, goal))
    for name in default:
        other = law(task, *own, **{name: 3.3}).torque(state, goal)
        assert np.abs(other - plain.torque(state, goal)).max() > 1e-3


def test_joint_space(rng: np.random.Generator) -> None:
    dynamics = models.dynamics("panda")
    state = Measured(rng.uniform(-1.0, 1.0, 7), rng.uniform(-1.0, 1.0, 7))
    reference = Reference(*rng.uniform(-1.0, 1.0, (3, 7)))

    def torque(control: Controller) -> np.ndarray:
        return control.torque(state, reference)

    exact = ComputedTorque(dynamics, 20.0, 1.0, 1e-3)
    np.testing.assert_array_equal(torque(ComputedTorque(dynamics)), torque(exact))
    damped = JointImpedance(dynamics, 50.0, 0.7)
    np.testing.assert_array_equal(torque(JointImpedance(dynamics, 50.0)), torque(damped))


def test_around_a_controller(rng: np.random.Generator) -> None:
    """An observer of 20/s, and a hand-over of 0.2 s."""
    dynamics = models.dynamics("panda")
    states = [Measured(*rng.uniform(-1.0, 1.0, (2, 7))) for _ in range(3)]
    reference = Reference(*rng.uniform(-1.0, 1.0, (3, 7)))
    plain, said = (
        DisturbanceObserver(ComputedTorque(dynamics), dynamics, 1e-3, *more)
        for more in ((), (20.0,))
    )
    for state in states:
        np.testing.assert_array_equal(
            plain.torque(state, reference), said.torque(state, reference)
        )
    assert np.abs(plain.disturbance).max() > 0.0
    switch, ticks = Switch(ComputedTorque(dynamics), 1e-3), 0
    switch.torque(states[0], reference)
    switch.to(ComputedTorque(dynamics, 5.0))
    while switch.fading:
        switch.torque(states[0], reference)
        ticks += 1
    assert ticks == 200
