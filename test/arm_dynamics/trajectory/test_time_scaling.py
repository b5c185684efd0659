# SPDX-License-Identifier: Apache-2.0
"""How much slower a motion must be for its torques, with friction of every kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, InvalidInput, Unreachable
from arm_dynamics.trajectory.time_scaling import torque_limits, torque_stretch
from models.rotor import rotor
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

FRICTION: dict[str, dict[str, Any]] = {
    "none": {"viscous": 0.0, "coulomb": 0.0},
    "viscous": {"viscous": 2.0, "coulomb": 0.0},
    "dry": {"viscous": 0.5, "coulomb": 1.5},
    "bristles": {"viscous": 0.5, "coulomb": 1.5, "lugre": {"sigma0": 1e5}},
}


@pytest.mark.parametrize("speed", [2.0, -2.0])
@pytest.mark.parametrize("rise", [5.0, -5.0])
def test_a_wheel_with_friction_of_every_kind(speed: float, rise: float) -> None:
    """F + b v x + J a x² = T along the motion, F + b v x - J a x² = T where it brakes hard."""
    inertia, b, dry, limit = 0.5, 0.2, 0.4, 1.5
    dyn = Dynamics(rotor(inertia, viscous=b, coulomb=dry))
    motion = np.zeros((1, 1)), np.array([[speed]]), np.array([[rise]])
    x = 1.0 / torque_stretch(dyn, *motion, np.array([limit]))
    push = inertia * 5.0 * x**2
    if speed * rise > 0.0:
        assert_close(dry + b * 2.0 * x + push, limit, ALGEBRA)
    else:
        assert_close(push - b * 2.0 * x - dry, limit, ALGEBRA)


@pytest.mark.parametrize("kind", FRICTION)
def test_at_that_pace_one_torque_is_at_its_limit(kind: str, rng: np.random.Generator) -> None:
    given = models.scene("two_link").model_dump(exclude_none=True)
    dyn = Dynamics(given | {"joints": {"*": {"friction": FRICTION[kind]}}})
    q, v, a = (rng.normal(0.0, s, (20, 2)) for s in (1.0, 3.0, 30.0))
    limit = abs(dyn.gravity(q)).max(axis=0) + 3.0
    stretch = torque_stretch(dyn, q, v, a, limit)
    assert stretch > 1.2
    share = abs(dyn.inverse(q, v / stretch, a / stretch**2)) / limit
    assert_close(share.max(), 1.0, INVERSE_PAIR)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_dry_friction_beyond_the_limit_is_said_whichever_way_it_pushes(sign: float) -> None:
    """No pace helps: friction of 0.4 against a limit of 0.3, both ways."""
    dyn = Dynamics(rotor(0.5, viscous=0.0, coulomb=0.4))
    motion = np.zeros((1, 1)), np.array([[sign]]), np.zeros((1, 1))
    with pytest.raises(Unreachable, match=r"take 0\.4 along .* its limit is 0\.3$"):
        torque_stretch(dyn, *motion, np.array([0.3]))


def test_a_limit_that_standing_takes_up_leaves_nothing_to_move_with() -> None:
    """At a limit of exactly the dry friction no pace is slow enough; just above it one is."""
    dyn = Dynamics(rotor(0.5, viscous=0.0, coulomb=0.4))
    motion = np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1))
    with pytest.raises(Unreachable) as caught:
        torque_stretch(dyn, *motion, np.array([0.4]))
    assert caught.value.residual == 0.0
    assert torque_stretch(dyn, *motion, np.array([0.4001])) > 10.0


@pytest.mark.parametrize(("joint", "name"), [(0, "joint1"), (1, "joint2"), (2, "joint3")])
def test_the_joint_that_cannot_bear_its_weight_is_named(joint: int, name: str) -> None:
    """At the point of the motion where it lacks most."""
    dyn = models.dynamics("planar_3r")
    q = np.array([[np.pi / 2, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    still = np.zeros_like(q)
    most = abs(dyn.gravity(q)[1])
    limit = most + 1.0
    limit[joint] = 0.5 * most[joint]
    said = f"joint '{name}' take {most[joint]:.4g} along .* limit is {limit[joint]:.4g}$"
    with pytest.raises(Unreachable, match=said) as caught:
        torque_stretch(dyn, q, still, still, limit)
    assert_close(caught.value.residual, 0.5 * most[joint], INVERSE_PAIR)


def test_torque_limits_are_the_callers_or_the_models() -> None:
    dyn = models.dynamics("planar_3r")
    assert torque_limits(dyn, None).tolist() == [80.0, 40.0, 20.0]
    assert torque_limits(dyn, 5.0).tolist() == [5.0, 5.0, 5.0]
    assert torque_limits(dyn, [1.0, np.inf, 3.0]).tolist() == [1.0, np.inf, 3.0]
    for bad in (0.0, -1.0, [1.0, 2.0], np.nan):
        with pytest.raises(InvalidInput, match="^limit is"):
            torque_limits(dyn, bad)
