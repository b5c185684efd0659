# SPDX-License-Identifier: Apache-2.0
"""How much slower a motion must be for its torques, with friction of every kind."""

from typing import Any

import numpy as np
import pytest

import models
from arm_dynamics import Dynamics, InvalidInput, Unreachable
from arm_dynamics.trajectory.timing import scaling
from arm_dynamics.trajectory.timing.scaling import OVERSHOOT, Capacity, Strain, refined_shares
from models.rotor import rotor
from tolerances import ALGEBRA, INVERSE_PAIR, assert_close

FRICTION: dict[str, dict[str, Any]] = {
    "none": {"viscous": 0.0, "coulomb": 0.0},
    "viscous": {"viscous": 2.0, "coulomb": 0.0},
    "dry": {"viscous": 0.5, "coulomb": 1.5},
    "falling": {"coulomb": 0.5, "static": 1.5, "stribeck_velocity": 0.5},
    "loaded": {"coulomb": 0.5, "load": {"at": [0.0, 50.0], "factor": [1.0, 3.0]}},
    "bristles": {"viscous": 0.5, "coulomb": 1.5, "lugre": {"sigma0": 1e5}},
}


def torque_stretch(
    dyn: Dynamics, q: np.ndarray, v: np.ndarray, a: np.ndarray, limit: np.ndarray
) -> float:
    """How much slower the motion through these points must be for its torques."""
    return 1.0 / Strain(Capacity(dyn, limit), q, v, a).pace()


@pytest.mark.parametrize(("speed", "rise"), [(2.0, 5.0), (-2.0, 5.0)])
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
    gear = {"efficiency": 1.0 if kind == "bristles" else 0.7}
    dyn = Dynamics(given | {"joints": {"*": {"friction": FRICTION[kind], "actuator": gear}}})
    q, v, a = (rng.normal(0.0, s, (20, 2)) for s in (1.0, 3.0, 30.0))
    limit = (abs(dyn.gravity(q)).max(axis=0) + 3.0) / 0.7
    stretch = torque_stretch(dyn, q, v, a, limit)
    assert stretch > 1.2
    share = abs(dyn.inverse(q, v / stretch, a / stretch**2)) / limit
    assert_close(share.max(), 1.0, INVERSE_PAIR)


def test_a_limit_that_standing_takes_up_leaves_nothing_to_move_with() -> None:
    """At a limit of exactly the dry friction no pace is slow enough; just above it one is."""
    dyn = Dynamics(rotor(0.5, viscous=0.0, coulomb=0.4))
    motion = np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1))
    with pytest.raises(Unreachable) as caught:
        torque_stretch(dyn, *motion, np.array([0.4]))
    assert caught.value.residual == 0.0
    assert torque_stretch(dyn, *motion, np.array([0.4001])) > 10.0


def test_the_joint_that_cannot_bear_its_weight_is_named() -> None:
    """At the point of the motion where it lacks most."""
    joint = 1
    dyn = models.dynamics("planar_3r")
    q = np.array([[np.pi / 2, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    still = np.zeros_like(q)
    most = abs(dyn.gravity(q)[1])
    limit = most + 1.0
    limit[joint] = 0.5 * most[joint]
    said = f"joint 'joint2' take {most[joint]:.4g} N m along .* limit is {limit[joint]:.4g} N m$"
    with pytest.raises(Unreachable, match=said) as caught:
        torque_stretch(dyn, q, still, still, limit)
    assert_close(caught.value.residual, 0.5 * most[joint], INVERSE_PAIR)


def test_what_rises_between_points_is_seen() -> None:
    """A bump that exceeds one by 2e-5 between two of the first points."""
    top = 0.03125 * 1.1

    def bump(t: np.ndarray) -> np.ndarray:
        return 2.0 * (t[:, None] - top) ** 2 - (1.0 + 2.0 * OVERSHOOT)

    times, shares = refined_shares(bump, np.linspace(0.0, 1.0, 9))
    assert 1.0 + OVERSHOOT < abs(shares).max() <= 1.0 + 2.0 * OVERSHOOT
    assert np.all(np.diff(times) >= 0.0) and shares.shape == (*times.shape, 1)


def test_motions_that_bend_everywhere_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scaling, "_LARGEST_COUNT", 50)
    noise = np.random.default_rng(0)
    with pytest.raises(InvalidInput, match="bends in more than 50 places"):
        refined_shares(lambda t: noise.uniform(0.0, 2.0, (len(t), 1)), np.linspace(0.0, 1.0, 101))


def test_a_limit_of_zero_leaves_only_joints_that_rest() -> None:
    capacity = Capacity(
        models.dynamics("planar_3r"), np.full(3, np.inf), np.array([0.0, 1.0, 1.0])
    )
    resting, moving = (np.array([[v, 2.0, 0.0]]) for v in (0.0, 1e-3))
    assert Strain(capacity, 0.0 * resting, resting, 0.0 * resting).pace() == pytest.approx(0.5)
    with pytest.raises(Unreachable, match="limit of zero"):
        Strain(capacity, 0.0 * moving, moving, 0.0 * moving).pace()
