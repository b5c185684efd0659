# SPDX-License-Identifier: Apache-2.0
"""Goals that take long to plan: the loop goes on, and plans that come too late are made again."""

import time

import numpy as np
import pytest
from byte_order import sent
from hand_goals import FRAME, HOME, MS, controller_at_home, long_trajectory, path, planned, see
from harness import Ros
from nav_msgs.msg import Path
from rclpy.parameter import Parameter
from samples import sampled
from trajectory_msgs.msg import JointTrajectory

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.controller.goals import Goal
from arm_dynamics.ros.interfaces import MAX_GOAL_POINTS
from arm_dynamics.trajectory.follower import Outset
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
from tolerances import assert_close

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> ControllerNode:
    """Controls a Panda that has been seen at home."""
    return controller_at_home(ros)


def test_a_long_trajectory_in_motion_takes_over_without_a_jump(node: ControllerNode) -> None:
    node.on_joint_trajectory(long_trajectory(10, 1.0))
    see(node, 300 * MS)
    old = [node.goals.follower.reference((300 + k) * MS) for k in range(1000)]
    node.on_joint_trajectory(long_trajectory(500, 2.0, late=0.7))
    planned(node, 301 * MS)
    new = [node.goals.follower.reference((301 + k) * MS) for k in range(3000)]
    assert_close(new[0].q, old[1].q, 1e-12)
    q, v = (np.array([getattr(r, name) for r in new]) for name in "qv")
    np.testing.assert_allclose(np.diff(q, axis=0), 0.5e-3 * (v[1:] + v[:-1]), atol=1e-6)
    assert_close(q[-1], HOME + 0.2, 1e-12)


def test_a_plan_that_comes_too_late_is_made_again(node: ControllerNode) -> None:
    """States pass faster than planning allows for, as with a simulator that runs ahead."""
    node.on_joint_trajectory(long_trajectory(10, 60.0))
    see(node, 300 * MS)
    node.on_joint_trajectory(long_trajectory(500, 2.0))
    stamp = 300 * MS
    end = time.monotonic() + 20.0
    while node.goals.planner.busy and time.monotonic() < end:
        stamp += 20 * MS
        time.sleep(2e-3)
        see(node, stamp)
    assert node.goals.follower.remaining(stamp) < 10.0
    assert_close(node.goals.follower.reference(stamp + 10_000 * MS).q, HOME + 0.2, 1e-12)


def test_a_goal_that_is_never_planned_in_time_is_refused(node: ControllerNode) -> None:
    """Each plan gets twice the time of the one before it; the motion goes on."""
    node.on_joint_trajectory(long_trajectory(10, 60.0))
    see(node, 300 * MS)
    before, begins = node.goals.follower, [299 * MS]
    ended: list[object] = []

    def plan(outset: Outset) -> Motion:
        begins.append(outset.begin)
        return hold(outset.here.q)

    node.goals.follow(Goal("goal", "a stop", None, plan, ended.append))
    end = time.monotonic() + 20.0
    while not ended and time.monotonic() < end:
        if node.goals.planner.ready:
            node.goals.reference(begins[-1] + MS)
            node.deliver()
        time.sleep(1e-4)
    assert ended == [None]
    assert (np.diff(begins) - MS).tolist() == [50 * MS << k for k in range(9)]
    assert node.goals.outcome.startswith("goal refused: the arm's reference changed faster")
    assert node.goals.follower is before
    assert_close(node.goals.follower.reference(60_000 * MS).q, HOME + 0.2, 1e-12)


def test_another_frame_is_built_in_the_background_and_used_when_ready(ros: Ros) -> None:
    node = ros.add(
        ControllerNode, models.scene("panda"), controller="operational_space", task_frame=FRAME,
        switch_time=0.0,
    )  # fmt: skip
    see(node, 0)
    law = node.control.active
    wanted = [
        Parameter("task_frame", value="panda_link6"),
        Parameter("task_axes", value="position"),
    ]
    assert node.set_parameters_atomically(wanted).successful
    assert node.params.settings.frame == "panda_link6"
    end = time.monotonic() + 20.0
    while node.busy and time.monotonic() < end:
        assert node.control.active is law
        time.sleep(1e-3)
        see(node, MS)
    assert node.control.active is not law
    assert np.isfinite(see(node, 2 * MS)).all()


@pytest.mark.parametrize("order", sampled([">", "<"], 1))
def test_a_long_trajectory_over_the_wire_is_followed(
    ros: Ros, node: ControllerNode, order: str
) -> None:
    publisher = ros.publisher(JointTrajectory, "/controller/joint_trajectory")
    publisher.publish(sent(long_trajectory(1000, 4.0), order))
    ros.spin_until(lambda: node.goals.planner.busy)
    planned(node, MS)
    assert node.goals.follower.remaining(MS) == pytest.approx(4.0)
    assert_close(node.goals.follower.reference(MS).q, HOME, 1e-12)
    assert_close(node.goals.follower.reference(2001 * MS).q, HOME + 0.1, 1e-6)
    assert_close(node.goals.follower.reference(5000 * MS).q, HOME + 0.2, 1e-12)


def test_damaged_goals_are_refused_and_the_arm_holds(
    ros: Ros, node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    before = see(node, MS)
    for kind, name, raw in (
        (JointTrajectory, "joint_trajectory", sent(long_trajectory(100, 1.0))),
        (Path, "cartesian_path", sent(path([0, 0.1, 0]))),
    ):
        publisher = ros.publisher(kind, f"/controller/{name}")
        for damaged in (raw[: len(raw) // 2], raw[:10], b"\0\7\0\0" + raw[4:]):
            node.goals.outcome = ""
            publisher.publish(damaged)
            ros.spin_until(lambda: node.goals.outcome)
            planned(node, MS)
            assert "refused: the message" in node.goals.outcome
    told = capfd.readouterr().err
    assert told.count("refused: the message") == 6, "each has a reason"
    assert node.goals.refused == 6
    np.testing.assert_array_equal(see(node, 1000 * MS), before)


def test_as_many_points_as_are_allowed_are_followed_and_not_one_more(
    node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    message = long_trajectory(MAX_GOAL_POINTS, 40.0)
    node.on_joint_trajectory(message)
    planned(node, MS)
    assert node.goals.follower.remaining(MS) == pytest.approx(40.0)
    message.points.append(message.points[-1])
    node.on_joint_trajectory(message)
    assert not node.goals.planner.busy
    wanted = f"{MAX_GOAL_POINTS + 1} points; allowed: up to {MAX_GOAL_POINTS}"
    assert wanted in node.goals.outcome
    assert wanted in capfd.readouterr().err
