# SPDX-License-Identifier: Apache-2.0
"""Tolerances on the way and at the goal, and their time."""

import math

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory

from arm_dynamics.control.controller import Measured
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.controller.action_goal import follow_params, tolerances
from arm_dynamics.ros.controller.tolerances import (
    NONE,
    StateTolerance,
    Tolerances,
    Verdict,
    effective,
)
from arm_dynamics.trajectory import Reference

pytestmark = pytest.mark.ros

ANY = StateTolerance((NONE,) * 2, (NONE,) * 2)
PATH = StateTolerance((0.1, 0.2), (NONE, NONE))
GOAL = StateTolerance((0.01, NONE), (0.05, 0.05))
THERE = Reference(np.array([1.0, 2.0]), np.zeros(2), np.zeros(2))


def test_zero_is_the_default_of_a_tolerance_and_minus_one_none() -> None:
    for asked, holds in ((0.3, 0.3), (0.0, 0.7), (-1.0, NONE), (-1.0 - 1e-7, NONE)):
        assert effective("position", asked, 0.7) == holds
    for asked in (-1.01, math.nan):
        with pytest.raises(InvalidInput, match=f"goal_time is {asked}; allowed: 0"):
            effective("goal_time", asked, 0.0)


def test_without_tolerances_of_its_own_a_goal_has_those_of_the_parameters() -> None:
    joints = ["shoulder", "elbow"]
    for parameters, path, goal in (
        ({"stopped_velocity_tolerance": 0.0}, ANY, ANY),
        (
            {"trajectory_0": 0.1, "goal_1": 0.2},
            StateTolerance((0.1, NONE), (NONE, NONE)), StateTolerance((NONE, 0.2), (0.01, 0.01)),
        ),
    ):  # fmt: skip
        given = follow_params(joints)(**parameters)
        found = tolerances(FollowJointTrajectory.Goal(), given, joints, ())
        assert found == Tolerances(path, goal)


@pytest.mark.parametrize(
    ("left", "off", "speed", "verdict"),
    [
        (0.5, [0.1, 0.2], 3.0, None),  # on the way only the path counts
        (1e-9, [0.0, -0.21], 0.0, Verdict.LEFT_PATH),
        (0.0, [0.009, 9.0], 0.0, Verdict.REACHED),  # from the end on only the goal
        (-0.5, [0.011, 0.0], 0.0, None),
        (-0.5, [0.0, 0.0], 0.06, None),
        (-0.51, [0.011, 0.0], 0.0, Verdict.MISSED_GOAL),
        (0.5, [0.0, 2.0 * math.pi + 0.15], 0.0, None),  # the elbow turns without end
        (0.5, [2.0 * math.pi + 0.05, 0.0], 0.0, Verdict.LEFT_PATH),
    ],
)
def test_verdicts(left: float, off: list[float], speed: float, verdict: Verdict | None) -> None:
    rules = Tolerances(PATH, GOAL, goal_time=0.5, turning=(1,))
    state = Measured(THERE.q - off, np.array([speed, 0.0]))
    assert rules.verdict(left, THERE, state) is verdict
    if verdict is None:  # without a time it waits for ever
        assert Tolerances(PATH, GOAL, turning=(1,)).verdict(2 * left, THERE, state) is None


def test_the_worst_joint_is_named() -> None:
    rules, names = Tolerances(PATH, GOAL), ("shoulder", "elbow")
    state = Measured(THERE.q - [0.11, 0.5], np.zeros(2))
    said = rules.worst(Verdict.LEFT_PATH, names, THERE, state)
    assert said == "position of joint 'elbow' is off by 0.5; allowed: 0.2"
    state = Measured(THERE.q, np.array([0.0, -0.3]))
    said = rules.worst(Verdict.MISSED_GOAL, names, THERE, state)
    assert said == "velocity of joint 'elbow' is off by 0.3; allowed: 0.05"
