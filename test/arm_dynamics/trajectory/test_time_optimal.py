# SPDX-License-Identifier: Apache-2.0
"""The quickest timing of a path: bang-bang where that is known, within every limit, or refused."""

from __future__ import annotations

import sys
from functools import cache

import numpy as np
import pytest

import models
from arm_dynamics import ArmError, Dynamics, InvalidInput, Unreachable
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import (
    JointPath,
    Quintic,
    Trajectory,
    joint_path,
    line,
    paced,
    retimed,
    timed,
)
from arm_dynamics.trajectory.time_optimal import Profile
from models.rotor import rotor
from tolerances import ALGEBRA, FINITE_DIFF, assert_close

pytestmark = pytest.mark.filterwarnings("ignore::SyntaxWarning")  # docstrings of toppra


@pytest.fixture
def toppra() -> object:
    """The library, which is an option."""
    return pytest.importorskip("toppra")


@cache
def straight() -> JointPath:
    dyn = models.dynamics("panda")
    task = TaskSpace(dyn, "panda_hand_tcp")
    pose = task.pose(dyn.model.q0)
    goal = Pose(pose.position + [0.05, 0.3, -0.25], pose.rotation)
    return joint_path(task, timed(line(pose, goal), 0.5, 2.0), dyn.model.q0)


def test_a_profile_is_covered_with_constant_accelerations() -> None:
    us = np.linspace(0.0, 1.0, 101)
    made = Profile.of(us, np.sqrt(2.0 * 3.0 * np.minimum(us, 1.0 - us)))  # ±3/s²
    assert made.duration == pytest.approx(2.0 / np.sqrt(3.0), rel=1e-12)
    for t in (0.1, 0.4, 0.8, 1.1):
        u, rate, rise = made.at(t)
        rest = made.duration - t
        assert_close(u, 1.5 * t**2 if t < rest else 1.0 - 1.5 * rest**2, ALGEBRA)
        assert_close([rate, rise], [3.0 * min(t, rest), 3.0 if t < rest else -3.0], 1e-8)
        slow = made.slower(2.0).at(2.0 * t)
        assert_close(slow, [u, rate / 2.0, rise / 4.0], ALGEBRA)
    assert made.at(-1.0) == (0.0, 0.0, 0.0)
    assert made.at(9.0) == (1.0, 0.0, 0.0)


def test_one_joint_with_an_acceleration_limit_is_bang_bang(toppra: object) -> None:
    """From rest to rest over 1 rad with 2 rad/s²: 2 √(1/2) s."""
    dyn = models.dynamics("pendulum")
    over = Trajectory(
        np.array([0.0, 1.0]),
        np.array([[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]),
        np.array([[0.0], [1.0]]),
    )
    quick = retimed(JointPath(over, Quintic(9.0)), dyn, np.inf, 2.0)
    assert quick.duration == pytest.approx(2.0 * np.sqrt(0.5), rel=1e-3)


def test_dry_friction_helps_to_brake(toppra: object) -> None:
    """Up with (T - F)/J and down with (T + F)/J, over 1 rad."""
    inertia, dry, most = 0.1, 1.0, 2.0
    over = Trajectory(
        np.array([0.0, 1.0]),
        np.array([[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]),
        np.array([[0.0], [1.0]]),
    )
    dyn = Dynamics(rotor(inertia, coulomb=dry))
    quick = retimed(JointPath(over, Quintic(9.0)), dyn, most)
    wanted = np.sqrt(2.0 * inertia * (1.0 / (most - dry) + 1.0 / (most + dry)))
    assert quick.duration == pytest.approx(wanted, rel=5e-3)


def test_a_spring_helps_to_brake(toppra: object) -> None:
    """Over 1 rad away from its rest on ±T: two arcs of harmonic motion, about T/k and -T/k.

    The work of ±T is what the spring has in the end, T x - T (1 - x) = k/2.
    """
    inertia, k, most = 0.1, 1.5, 2.0
    over = Trajectory(
        np.array([0.0, 1.0]),
        np.array([[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]]]),
        np.array([[0.0], [1.0]]),
    )
    scene = rotor(inertia)
    scene["joints"]["axle"]["spring"] = {"stiffness": k}
    quick = retimed(JointPath(over, Quintic(9.0)), Dynamics(scene), most)
    x, rest = 0.5 + 0.25 * k / most, most / k
    wanted = np.arccos(1.0 - x / rest) + np.arccos((x + rest) / (1.0 + rest))
    assert quick.duration == pytest.approx(wanted / np.sqrt(k / inertia), rel=5e-3)


@pytest.mark.parametrize(
    ("torque", "acceleration"), [(None, np.inf), (30.0, 15.0), (30.0, np.inf)]
)
def test_limits_hold_and_one_is_reached(
    toppra: object, torque: float | None, acceleration: float
) -> None:
    dyn, motion = models.dynamics("panda"), straight()
    quick = retimed(motion, dyn, torque, acceleration)
    _, q, v, a = quick.table(900)
    most = dyn.model.effort_limit if torque is None else np.full(7, torque)
    used = [
        (abs(dyn.inverse(q, v, a)) / most).max(),
        (abs(v) / dyn.model.velocity_limit).max(),
        abs(a).max() / acceleration,
    ]
    assert max(used) <= 1.0 + 5e-3
    assert max(used) > 0.95
    smooth = paced(motion.slower(0.05), dyn, torque, acceleration=acceleration)
    assert quick.duration < 0.8 * smooth.duration


def test_it_is_the_same_way(toppra: object) -> None:
    dyn, motion = models.dynamics("panda"), straight()
    quick = retimed(motion, dyn, None, 15.0)
    assert_close(quick.sample(0.0).q, motion.sample(0.0).q, ALGEBRA)
    assert_close(quick.sample(9.0).q, motion.sample(99.0).q, ALGEBRA)
    h = 1e-6
    for t in np.linspace(0.1, 0.9, 5) * quick.duration:
        before, now, after = (quick.sample(t + s * h) for s in (-1, 0, 1))
        np.testing.assert_allclose((after.q - before.q) / (2 * h), now.v, atol=FINITE_DIFF)


def test_what_cannot_be_is_refused(toppra: object) -> None:
    dyn, motion = models.dynamics("panda"), straight()
    with pytest.raises(Unreachable):
        retimed(motion, dyn, 5.0)  # the weight alone takes more
    with pytest.raises(InvalidInput, match="points = 3"):
        retimed(motion, dyn, points=3)
    with pytest.raises(InvalidInput, match="nothing limits the motion"):
        retimed(motion, dyn, np.inf)
    with pytest.raises(InvalidInput, match="acceleration is -1"):
        retimed(motion, dyn, None, -1.0)


def test_without_the_library_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "toppra", None)
    with pytest.raises(ArmError, match="pip install toppra"):
        retimed(straight(), models.dynamics("panda"))
