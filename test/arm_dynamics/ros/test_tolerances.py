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
    resolved,
)
from arm_dynamics.trajectory import Reference

pytestmark = pytest.mark.ros

ANY = StateTolerance((NONE,) * 2, (NONE,) * 2)
PATH = StateTolerance((0.1, 0.2), (NONE, NONE))
GOAL = StateTolerance((0.01, NONE), (0.05, 0.05))
THERE = Reference(np.array([1.0, 2.0]), np.zeros(2), np.zeros(2))


def verdict(rules: Tolerances, left: float, off: list[float], speed: float = 0.0) -> object:
    return rules.verdict(left, THERE, Measured(THERE.q - off, np.array([speed, 0.0])))


@pytest.mark.parametrize(
    ("asked", "holds"),
    [(0.3, 0.3), (0.0, 0.7), (-1.0, NONE), (-1.0 - 1e-7, NONE), (math.inf, NONE)],
    ids=["own", "default", "none", "none up to rounding", "infinite"],
)
def test_special_values_of_a_tolerance(asked: float, holds: float) -> None:
    assert resolved("position", asked, 0.7) == holds


@pytest.mark.parametrize("asked", [-0.5, -1.01, -2.0, math.nan, -math.inf])
def test_other_values_are_refused(asked: float) -> None:
    with pytest.raises(InvalidInput, match=f"goal_time is {asked}; allowed: 0"):
        resolved("goal_time", asked, 0.0)


@pytest.mark.parametrize(
    ("parameters", "rules"),
    [
        ({}, Tolerances(ANY, StateTolerance((NONE, NONE), (0.01, 0.01)))),
        ({"stopped_velocity_tolerance": 0.0}, Tolerances(ANY, ANY)),
        (
            {"trajectory_0": 0.1, "goal_1": 0.2, "goal_time": 3.0},
            Tolerances(
                StateTolerance((0.1, NONE), (NONE, NONE)),
                StateTolerance((NONE, 0.2), (0.01, 0.01)),
                3.0,
            ),
        ),
    ],
    ids=["defaults", "0 for any speed", "of one joint"],
)
def test_without_tolerances_of_its_own_a_goal_has_those_of_the_parameters(
    parameters: dict[str, float], rules: Tolerances
) -> None:
    joints = ["shoulder", "elbow"]
    given = follow_params(joints)(**parameters)
    assert tolerances(FollowJointTrajectory.Goal(), given, joints, ()) == rules


def test_on_the_way_only_the_path_counts() -> None:
    rules = Tolerances(PATH, GOAL)
    assert verdict(rules, 0.5, [0.1, 0.2], speed=3.0) is None
    assert verdict(rules, 0.5, [0.0, -0.21]) is Verdict.LEFT_PATH
    assert verdict(rules, 1e-9, [0.11, 0.0]) is Verdict.LEFT_PATH


def test_from_the_end_on_only_the_goal_counts() -> None:
    rules = Tolerances(PATH, GOAL)
    assert verdict(rules, 0.0, [0.009, 9.0]) is Verdict.REACHED
    assert verdict(rules, -1.0, [0.011, 0.0]) is None
    assert verdict(rules, -1.0, [0.0, 0.0], speed=0.06) is None
    assert verdict(rules, -1e6, [0.011, 0.0]) is None  # for ever, unless there is a time


def test_a_goal_time_ends_the_wait() -> None:
    rules = Tolerances(ANY, GOAL, goal_time=0.5)
    assert verdict(rules, -0.5, [0.02, 0.0]) is None
    assert verdict(rules, -0.51, [0.02, 0.0]) is Verdict.MISSED_GOAL
    assert verdict(rules, -0.51, [0.0, 0.0]) is Verdict.REACHED


def test_a_joint_that_turns_without_end_takes_the_shorter_way() -> None:
    off = [2.0 * math.pi + 0.05, 0.0]
    assert verdict(Tolerances(PATH, GOAL), 0.5, off) is Verdict.LEFT_PATH
    assert verdict(Tolerances(PATH, GOAL, turning=(0,)), 0.5, off) is None


def test_the_worst_joint_is_named() -> None:
    rules, names = Tolerances(PATH, GOAL), ("shoulder", "elbow")
    state = Measured(THERE.q - [0.11, 0.5], np.zeros(2))
    said = rules.worst(Verdict.LEFT_PATH, names, THERE, state)
    assert said == "position of joint 'elbow' is off by 0.5; allowed: 0.2"
    state = Measured(THERE.q, np.array([0.0, -0.3]))
    said = rules.worst(Verdict.MISSED_GOAL, names, THERE, state)
    assert said == "velocity of joint 'elbow' is off by 0.3; allowed: 0.05"
