# SPDX-License-Identifier: Apache-2.0
"""Which trajectories the controller node takes, and how it follows them."""

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from two_link_control import MS, NAMES, effort, point, reference_of, trajectory, wanted

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.trajectory import Reference
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> ControllerNode:
    """Controls a two-link arm."""
    return ros.add(ControllerNode, models.scene("two_link"), bandwidth=[10.0])


@pytest.mark.parametrize("start", [5_000 * MS, 1_700_000_000_123_456_789])
def test_follows_a_trajectory_in_the_time_of_the_stamps(node: ControllerNode, start: int) -> None:
    effort(node, start, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(2.0, 1.0, -1.0)))
    for s in (0.0, 0.25, 0.5, 1.0, 1.5):
        u = min(s, 1.0)
        q = 10 * u**3 - 15 * u**4 + 6 * u**5
        v = (30 * u**2 - 60 * u**3 + 30 * u**4) / 2
        a = (60 * u - 180 * u**2 + 120 * u**3) / 4
        sign = np.array([1.0, -1.0])
        exact = Reference(q * sign, v * sign, a * sign)
        stamp = start + round(2e9 * s)
        assert_close(effort(node, stamp, (0.3, 0.1)), wanted((0.3, 0.1), (0, 0), exact), 1e-8)


def test_joints_that_a_trajectory_does_not_name_stay(node: ControllerNode) -> None:
    effort(node, 0, (0.3, -0.4))
    node.on_joint_trajectory(trajectory(point(1.0, 0.7), names=NAMES[1:]))
    for stamp in (0, 500 * MS, 1000 * MS):
        assert_close(reference_of(node, stamp)[:, 0], [0.3, 0.0, 0.0], ALGEBRA)
    assert_close(reference_of(node, 1000 * MS)[0], [0.3, 0.7], ALGEBRA)


def gripper(ros: Ros) -> ControllerNode:
    """Controls swing and left_slide; right_slide follows by 0.01 - 0.7 left_slide."""
    node = ros.add(ControllerNode, models.scene("gripper"))
    names = list(node.dynamics.joint_names)
    node.on_joint_states(
        serialize_message(JointState(name=names, position=[0.0, 0.0], velocity=[0.0, 0.0]))
    )
    return node


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (trajectory(point(1.0, 0.01), names=["right_slide"]), "right_slide follows left_slide; c"),
        (
            trajectory(point(1.0, 0.03, 0.03), names=["left_slide", "right_slide"]),
            "positions of point 0: right_slide is 0.03, but right_slide follows left_slide, so",
        ),
    ],
)
def test_mimic_joints_that_contradict_are_refused(
    ros: Ros, message: JointTrajectory, complaint: str
) -> None:
    node = gripper(ros)
    for again in ("", " (again)"):  # so that one who waits for the answer sees it
        node.on_joint_trajectory(message)
        assert complaint in node.goals.outcome and node.goals.outcome.endswith(again)
    assert not reference_of(node, 1000 * MS).any()


def test_given_velocities_and_accelerations_are_met(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    middle = point(1.0, 0.5, 0.5, velocities=[0.3, 0.4], accelerations=[0.1, -0.1])
    node.on_joint_trajectory(trajectory(middle, point(2.0, 1.0, 1.0)))
    assert_close(reference_of(node, 1000 * MS), [[0.5, 0.5], [0.3, 0.4], [0.1, -0.1]], ALGEBRA)


def test_header_stamp_is_when_time_from_start_begins(node: ControllerNode) -> None:
    effort(node, 1000 * MS, (0.0, 0.0))
    message = trajectory(point(1.0, 0.2, 0.2))
    message.header.stamp.sec = 3
    node.on_joint_trajectory(message)
    assert not reference_of(node, 3000 * MS).any()
    assert_close(reference_of(node, 3500 * MS)[0], [0.1, 0.1], ALGEBRA)
    assert_close(reference_of(node, 4000 * MS)[0], [0.2, 0.2], ALGEBRA)


def test_velocity_limits_slow_it_down(ros: Ros, capfd: pytest.CaptureFixture[str]) -> None:
    node = ros.add(ControllerNode, models.scene("panda"), acceleration_limit=5.0)
    model = models.dynamics("panda").model
    names, q = list(model.joint_names), model.q0
    raw = JointState(name=names, position=q.tolist(), velocity=[0.0] * 7)
    node.on_joint_states(serialize_message(raw))
    node.on_joint_trajectory(trajectory(point(0.1, *(q + 0.5)), names=names))
    assert "times slower for the limits" in capfd.readouterr().err
    moving = np.array([reference_of(node, k * MS) for k in range(2000)])
    assert np.all(np.abs(moving[:, 1]) <= model.velocity_limit)
    assert np.abs(moving[:, 2]).max() == pytest.approx(5.0, rel=1e-4)
    assert_close(moving[-1, 0], q + 0.5, ALGEBRA)


BAD = (
    (trajectory(), "no waypoint lies in the future"),
    (trajectory(point(0.0, 1.0, 1.0)), "no waypoint lies in the future"),
    (trajectory(point(1.0, 1.0)), "positions of point 0 has 1 numbers; allowed: 2"),
    (trajectory(point(1.0)), "positions of point 0 has 0 numbers"),
    (trajectory(point(1.0, 1.0, np.nan)), f"positions of point 0, joint '{NAMES[1]}', is nan"),
    (trajectory(point(1.0, 1.0, 1.0), point(1.0, 2.0, 2.0)), "increasing"),
    (trajectory(point(2.0, 1.0, 1.0), point(1.0, 2.0, 2.0)), "increasing"),
    (trajectory(point(1.0, 1.0, 1.0, velocities=[1.0])), "velocities of point 0 has 1"),
    (trajectory(point(1.0, 1.0, 1.0, velocities=[1.0, 1.0])), "last waypoint"),
    (trajectory(point(1.0, 1.0, 1.0, accelerations=[np.inf] * 2)), f"'{NAMES[0]}', is inf"),
    (trajectory(point(1.0, 1.0), names=["nobody"]), "unknown joints nobody; allowed: "),
    (trajectory(point(1.0, 1.0, 1.0), names=[NAMES[0]] * 2), "each once"),
    (trajectory(point(1.0), names=[]), "no joint names"),
)


def test_bad_trajectory_is_refused_once_and_the_old_one_goes_on(
    node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    effort(node, 0, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(1.0, 1.0, -1.0)))
    before = reference_of(node, 300 * MS)
    capfd.readouterr()
    for count, (message, complaint) in enumerate(BAD, 1):
        node.on_joint_trajectory(message)
        assert complaint in node.goals.outcome and node.goals.refused == count
        np.testing.assert_array_equal(reference_of(node, 300 * MS), before)
        if count == 1:  # many at once are not all logged
            assert capfd.readouterr().err.count("refused, the previous one continues") == 1


def test_goals_that_the_log_withholds_are_counted(
    ros: Ros, node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    effort(node, 0, (0.0, 0.0))
    for k in range(15):  # ten of them are logged
        node.on_joint_trajectory(trajectory(point(1.0, 1.0), names=[f"nobody{k}"]))
    ros.spin_until(lambda: "5 more goals refused since" in capfd.readouterr().err)


def test_efforts_of_points_are_added_to_the_controllers(node: ControllerNode) -> None:
    """Linear between the points and kept after the last, in the order of the message."""
    effort(node, 0, (0.0, 0.0))
    pushed = [point(t, 0.2, 0.4, effort=[t, -2.0 * t]) for t in (1.0, 2.0)]
    node.on_joint_trajectory(trajectory(*pushed, names=NAMES[::-1]))
    for time, added in ((0.0, 0.0), (0.5, 0.5), (1.2, 1.2), (1.9, 1.9), (2.5, 2.0)):
        stamp = round(time * 1000) * MS
        motion = Reference(*reference_of(node, stamp))
        found = effort(node, stamp, (0.3, 0.1)) - wanted((0.3, 0.1), (0, 0), motion)
        assert_close(found, [-2.0 * added, added], 1e-8)


def test_a_state_that_comes_again_is_answered_for_the_new_motion(node: ControllerNode) -> None:
    """As in lockstep, where the first state waits until the robot is told to move."""
    before = effort(node, 0, (0.0, 0.0))
    assert_close(effort(node, 0, (0.0, 0.0)), before, ALGEBRA)
    pushed = [point(t, 0.1, 0.1, effort=[3.0, 4.0]) for t in (0.0, 1.0)]
    node.on_joint_trajectory(trajectory(*pushed))
    assert_close(effort(node, 0, (0.0, 0.0)) - before, [3.0, 4.0], ALGEBRA)
