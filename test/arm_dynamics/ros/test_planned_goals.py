# SPDX-License-Identifier: Apache-2.0
"""Goals planned in the background, Cartesian or long: followed without a jump, or refused."""

import time

import numpy as np
import pytest
from byte_order import sent
from hand_goals import FRAME, HOME, hand, long_trajectory, path, planned, pose, see
from harness import Ros
from nav_msgs.msg import Path
from trajectory_msgs.msg import JointTrajectory
from two_link_control import MS

import models
from arm_dynamics import ArmModel, InvalidInput, load_scene
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.common.poses import in_world, pose_of
from arm_dynamics.ros.controller.goals import Goal
from arm_dynamics.trajectory.follower import Outset
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> ControllerNode:
    """Controls a Panda that has been seen at home."""
    made = ros.add(ControllerNode, models.scene("panda"), task_frame=FRAME)
    see(made, 0)
    return made


def test_planning_does_not_hold_up_the_loop(node: ControllerNode) -> None:
    """The response to the goal is immediate, and states are answered while it is planned."""
    before = see(node, MS)
    node.on_cartesian_goal(pose([0.0, 0.2, 0.0]))
    assert node.goals.planner.busy
    np.testing.assert_array_equal(see(node, MS), before)
    planned(node, 2 * MS)
    duration = node.goals.follower.remaining(2 * MS)
    assert node.goals.outcome == f"following a straight line for {duration:.3f} s"
    assert duration > 1.0
    assert_close(hand(node, 2 * MS + round(1e9 * duration)), [0.0, 0.2, 0.0], 1e-8)


def test_a_path_is_followed_through_its_poses(node: ControllerNode) -> None:
    node.on_cartesian_path(path([0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1]))
    planned(node, MS)
    duration = round(1e9 * node.goals.follower.remaining(MS))
    assert node.goals.outcome.startswith("following 3 poses for ")
    course = np.array([hand(node, MS + k * duration // 600) for k in range(601)])
    for corner in ([0, 0.1, 0], [0, 0.1, -0.1], [0, 0, -0.1]):
        assert np.linalg.norm(course - corner, axis=1).min() < 2e-3
    assert_close(course[-1], [0, 0, -0.1], 1e-8)


def test_goals_may_be_as_quick_as_the_joints_allow(ros: Ros) -> None:
    took = []
    for timing in ("smooth", "time_optimal"):
        node = ros.add(
            ControllerNode, models.scene("panda"), task_frame=FRAME, cartesian_timing=timing,
            cartesian_speed=9.0, cartesian_acceleration=100.0, acceleration_limit=10.0,
        )  # fmt: skip
        see(node, 0)
        node.on_cartesian_goal(pose([0.0, 0.2, -0.1]))
        planned(node, 0)
        took.append(node.goals.follower.remaining(0))
        assert_close(hand(node, 10_000 * MS), [0.0, 0.2, -0.1], 1e-8)
    assert took[1] < 0.9 * took[0]


def test_the_newest_goal_counts(node: ControllerNode, capfd: pytest.CaptureFixture[str]) -> None:
    node.on_cartesian_goal(pose([0.0, 0.2, 0.0]))
    node.on_cartesian_goal(pose([0.0, 0.0, -0.2]))
    planned(node, 0)
    assert "a newer goal replaces the one that was being planned" in capfd.readouterr().err
    assert_close(hand(node, 10_000 * MS), [0.0, 0.0, -0.2], 1e-8)


def test_a_refused_trajectory_leaves_a_goal_that_is_being_planned(node: ControllerNode) -> None:
    node.on_cartesian_goal(pose([0.0, 0.2, 0.0]))
    node.on_joint_trajectory(JointTrajectory())
    planned(node, 0)
    assert_close(hand(node, 10_000 * MS), [0.0, 0.2, 0.0], 1e-8)


BAD = [
    (pose([5.0, 0.0, 0.0]), "cannot be brought to position"),
    (pose([0.0, 0.1, 0.0], "panda_link5"), "poses in frame 'panda_link5'; allowed: fixed frames"),
    (path([0, 0.1, 0], [9.0, 0, 0]), "of its length"),
    (path([0, 0.1, 0], frame_id="nowhere"), "pose 0: poses in frame 'nowhere'"),
]


def test_a_bad_goal_is_refused_with_the_reason_and_the_arm_holds(
    node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    for second, (message, complaint) in enumerate(BAD):
        now = MS + 1000 * second * MS
        before = see(node, now)
        callback = node.on_cartesian_path if isinstance(message, Path) else node.on_cartesian_goal
        callback(message)
        planned(node, now + MS)
        if not second:  # what follows at once is not logged again
            said = capfd.readouterr().err
            assert "refused: " in said and complaint in said
        assert complaint in node.goals.outcome
        np.testing.assert_array_equal(see(node, now + 999 * MS), before)
        assert node.goals.follower.remaining(now + 999 * MS) == 0.0


def test_without_a_frame_or_a_state_goals_are_refused(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = ros.add(ControllerNode, models.scene("panda"))
    node.on_cartesian_goal(pose())
    assert "no joint state has been seen yet" in capfd.readouterr().err
    see(node, 0)
    node.on_cartesian_goal(pose())
    planned(node, 0)
    assert "parameter 'task_frame' is empty" in node.goals.outcome


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


def test_damaged_goals_are_refused_and_the_arm_holds(
    ros: Ros, node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    before = see(node, MS)
    for message, name in (
        (long_trajectory(100, 1.0), "joint_trajectory"), (path([0, 0.1, 0]), "cartesian_path")
    ):  # fmt: skip
        publisher, raw = ros.publisher(type(message), f"/controller/{name}"), sent(message)
        for length in (10, len(raw) // 2):
            node.goals.outcome = ""
            publisher.publish(raw[:length])
            ros.spin_until(lambda: node.goals.outcome)
            planned(node, MS)
            assert "refused: the message" in node.goals.outcome
    assert capfd.readouterr().err.count("refused: the message") == 4, "each has a reason"
    np.testing.assert_array_equal(see(node, 1000 * MS), before)


TURNED = """<robot name="turned">
  <link name="ground"/>
  <link name="stand"/>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="ground"/><child link="stand"/>
    <origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="hinge" type="continuous"><parent link="stand"/><child link="arm"/></joint>
</robot>"""
HALF = np.sqrt(0.5)


@pytest.fixture(scope="module")
def model() -> ArmModel:
    return ArmModel(load_scene({"robot": {"urdf": TURNED}}))


@pytest.mark.parametrize("frame", ["stand", "link:stand", "joint:mount"])
def test_a_pose_in_a_frame_that_stands_turned(model: ArmModel, frame: str) -> None:
    """A step along its x is one along the world's y, and rotations follow one another."""
    pose = in_world((1.0, 0.0, 0.5, HALF, 0.0, 0.0, HALF), frame, model)
    assert_close(pose.position, [1.0, 3.0, 3.5], ALGEBRA)
    quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # about z, of the stand
    roll = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]  # about x, of the pose
    assert_close(pose.rotation, np.array(quarter) @ roll, ALGEBRA)


def test_a_quaternion_has_length_one() -> None:
    for length in (0.9989, 1.0011):
        with pytest.raises(InvalidInput, match="expected 1"):
            pose_of((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, length))
    for length in (0.9991, 1.0009):
        slightly = pose_of((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, length))
        assert_close(slightly.rotation, np.eye(3), ALGEBRA)


def test_a_goal_that_is_never_planned_in_time_is_refused(node: ControllerNode) -> None:
    """Each plan gets twice the time of the one before it; the motion goes on."""
    node.on_joint_trajectory(long_trajectory(10, 60.0))
    see(node, 300 * MS)
    before, begins = node.goals.follower, [299 * MS]
    ended: list[object] = []

    def plan(outset: Outset) -> Motion:
        begins.append(outset.begin)
        return hold(outset.reference.q)

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
