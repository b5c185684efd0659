# SPDX-License-Identifier: Apache-2.0
"""What the controller takes for a jump of time or of the arm."""

import time
from threading import Event

import numpy as np
import pytest
from harness import Ros
from two_link_control import MS, effort, point, reference_of, still, trajectory, wanted

import models
from arm_dynamics.control.controller import Measured
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.controller.goals import Goal
from arm_dynamics.ros.controller.jumps import Jumps
from arm_dynamics.trajectory.follower import Outset
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
from tolerances import ALGEBRA, assert_close

NOW = 1_700_000_000 * 1000 * MS  # a stamp of a system's clock


def at(*q: float, speed: float = 0.0) -> Measured:
    return Measured(np.array(q), np.full(len(q), speed))


@pytest.mark.parametrize(
    ("gap", "state", "said"),
    [
        (0, at(0.0, 0.0), ""),
        (MS, at(0.4, -0.4), ""),
        (MS, at(0.0, -0.6), "joint 'b' moved by 0.6 in 0.001 s"),
        (MS, at(0.0, -0.6, speed=60.0), ""),  # (0.6 - 0.5) rad in 1 ms, at up to twice its speed
        (100 * MS, at(0.0, 1.0, speed=2.0), "joint 'b' moved by 1 in 0.1 s"),
        (-1, at(0.0, 0.0), "time went backwards"),
        (2000 * MS, at(0.0, 0.0), "time advanced by 2 s between two states"),
        (1000 * MS, at(0.0, 0.0), ""),  # as long as is allowed
        (0, at(0.0, 0.5), ""),  # as far as is allowed
    ],
)
def test_time_and_joints_jump(gap: int, state: Measured, said: str) -> None:
    jumps = Jumps(["a", "b"])
    assert not jumps.detect(NOW, at(0.0, 0.0), 1.0, 0.5)
    assert jumps.detect(NOW + gap, state, 1.0, 0.5) == said


def test_a_joint_that_was_fast_before_it_stopped_has_not_jumped() -> None:
    jumps = Jumps(["a", "b"])
    jumps.detect(NOW, at(0.0, 0.0, speed=60.0), 1.0, 0.5)
    assert not jumps.detect(NOW + MS, at(0.0, -0.6), 1.0, 0.5)
    assert jumps.detect(NOW + 2 * MS, at(0.0, 0.0), 1.0, 0.5), "it has stood since"


def test_zero_allows_any() -> None:
    jumps = Jumps(["a", "b"])
    jumps.detect(NOW, at(0.0, 0.0), 0.0, 0.0)
    assert not jumps.detect(NOW + 3600 * 1000 * MS, at(9.0, 9.0), 0.0, 0.0)


@pytest.mark.ros
def test_an_arm_that_was_put_elsewhere_is_held_there(ros: Ros) -> None:
    """As after a reset of a simulation whose stamps are those of a clock."""
    node = ros.add(ControllerNode, models.scene("two_link"), bandwidth=[10.0])
    effort(node, NOW, (0.1, -0.2))
    node.on_joint_trajectory(trajectory(point(2.0, 1.0, -1.0)))
    torque = effort(node, NOW + MS, (1.3, 0.4))
    assert_close(reference_of(node, NOW + MS)[0], (1.3, 0.4), ALGEBRA)
    assert_close(torque, wanted((1.3, 0.4), (0.0, 0.0), still(1.3, 0.4)), ALGEBRA)
    assert node.goals.outcome == (
        "the motion ended, joint 'shoulder' moved by 1.2 in 0.001 s; the arm is held where it is"
    )


@pytest.mark.ros
def test_a_jump_at_rest_says_nothing_of_the_last_goal(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"))
    effort(node, NOW, (0.1, -0.2))
    node.on_joint_trajectory(trajectory(point(0.5, 0.1, -0.2)))
    effort(node, NOW + 900 * MS, (0.1, -0.2))
    effort(node, NOW, (0.1, -0.2))
    assert node.goals.outcome.startswith("following 1 point")


@pytest.mark.ros
def test_a_jump_ends_what_is_being_planned(ros: Ros) -> None:
    node, ready = ros.add(ControllerNode, models.scene("two_link")), Event()
    effort(node, NOW, (0.1, -0.2))

    def plan(outset: Outset) -> Motion:
        ready.wait(20.0)
        return hold(outset.here.q + 0.1)

    node.goals.follow(Goal("goal", "a step", None, plan))
    assert node.goals.outcome == "planning goal: a step"
    effort(node, NOW - MS, (0.3, 0.4))
    ready.set()
    end = time.monotonic() + 20.0
    while node.busy and time.monotonic() < end:
        time.sleep(1e-3)
        node.deliver()
    said = "given up, time went backwards; the arm is held where it is"
    assert node.goals.outcome == said
    assert_close(reference_of(node, NOW)[0], (0.3, 0.4), ALGEBRA)
