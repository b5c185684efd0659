# SPDX-License-Identifier: Apache-2.0
"""Controllers take the springs of their model into account."""

from functools import cache

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics
from arm_dynamics.control import (
    DisturbanceObserver,
    GravityCompensation,
    JointImpedance,
    Measured,
    PDGravity,
)
from arm_dynamics.trajectory import Reference
from arm_dynamics.trajectory.timing.scaling import Capacity, Strain
from arm_sim import Simulator
from tolerances import ALGEBRA, INVERSE_PAIR, PINOCCHIO, assert_close

SCENE = {
    "robot": {"urdf": models.scene("two_link").robot.urdf},
    "joints": {"elbow": {"spring": {"stiffness": 12.0, "rest": 0.4, "damping": 0.3}}},
    "springs": [
        {
            "frames": ["forearm", "world"], "points": [[0.2, 0, 0], [0, 0, 0.7]],
            "stiffness": 60.0, "rest_length": 0.2, "damping": 2.0,
        }
    ],
}  # fmt: skip


@cache
def arm() -> Dynamics:
    return Dynamics(SCENE)


def test_arm_that_floats_stays(rng: np.random.Generator) -> None:
    """Gravity compensation balances weight and springs, so that the arm rests."""
    q, still = 0.5 * rng.normal(size=2), np.zeros(2)
    for control in (GravityCompensation(arm()), PDGravity(arm(), 10.0, 1.0)):
        tau = control.torque(Measured(q, still), Reference(q, still, still))
        assert_close(arm().forward(q, still, tau), still, INVERSE_PAIR)


def test_impedance_leaves_the_error_its_own_damping(rng: np.random.Generator) -> None:
    """Dampers are fed forward from the reference's speed, like viscous friction."""
    bare = Dynamics({"robot": SCENE["robot"]})
    q, v, a, q_d, v_d = 0.5 * rng.normal(size=(5, 2))
    more, less = (
        JointImpedance(dyn, 9.0).torque(Measured(q, v), Reference(q_d, v_d, a))
        for dyn in (arm(), bare)
    )
    assert_close(more - less, arm().spring(q, v_d), PINOCCHIO)


def test_observer_does_not_take_springs_for_a_disturbance() -> None:
    sim = Simulator(SCENE, dt=1e-3)
    observer = DisturbanceObserver(GravityCompensation(arm()), arm(), sim.dt, 50.0)
    sim.reset([0.6, -1.2], [1.0, -0.5])
    for _ in range(500):
        sim.step(observer.torque(sim.state, None))
    assert abs(observer.disturbance).max() < 0.02
    assert abs(arm().spring(sim.state.q)).max() > 1.0


def test_motion_is_slowed_for_what_springs_take() -> None:
    """Slowed by the factor found, the greatest torque is the limit."""
    s = np.linspace(0.0, 1.0, 201)[:, None]
    way = np.array([0.8, 0.9])
    q, v, a = way * np.sin(3 * s), 3 * way * np.cos(3 * s), -9 * way * np.sin(3 * s)
    limit = 1.02 * abs(arm().inverse(q, 0 * q, 0 * q)).max(axis=0)
    pace = 1.0 / Strain(Capacity(arm(), limit), q, v, a).pace()
    part = abs(arm().inverse(q, v / pace, a / pace**2)) / limit
    assert pace > 1.0
    assert part.max() == pytest.approx(1.0, abs=ALGEBRA)
