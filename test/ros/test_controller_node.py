# SPDX-License-Identifier: Apache-2.0
"""The controller node: what it answers to states, and which trajectories it takes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import TrackingState
from harness import Ros
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import models
from arm_dynamics import ArmError
from arm_dynamics.control import ComputedTorque, Measured
from arm_dynamics.motion import Reference
from arm_dynamics.ros.controller_node import ControllerNode
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros

DYNAMICS = models.dynamics("two_link")
NAMES = list(DYNAMICS.joint_names)
MS = 1_000_000


@pytest.fixture
def node(ros: Ros) -> ControllerNode:
    """Controls a two-link arm."""
    return ros.add(ControllerNode, models.scene("two_link"), bandwidth=[10.0])


def state(stamp: int, q: Any = (0.1, -0.2), v: Any = (0.0, 0.0), **more: Any) -> bytes:
    message = JointState(name=NAMES, position=list(q), velocity=list(v), **more)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    return serialize_message(message)


def point(time: float, *positions: float, **more: Any) -> JointTrajectoryPoint:
    made = JointTrajectoryPoint(positions=list(positions), **more)
    made.time_from_start.sec, made.time_from_start.nanosec = divmod(round(time * 10**9), 10**9)
    return made


def trajectory(*points: JointTrajectoryPoint, names: list[str] = NAMES) -> JointTrajectory:
    return JointTrajectory(joint_names=list(names), points=list(points))


def effort(node: ControllerNode, stamp: int, q: Any, v: Any = (0.0, 0.0)) -> np.ndarray:
    """What the node commands for a state."""
    return np.array(
        deserialize_message(node.on_joint_states(state(stamp, q, v)), JointState).effort
    )


def wanted(q: Any, v: Any, reference: Reference, bandwidth: Any = 10.0) -> np.ndarray:
    control = ComputedTorque(DYNAMICS, bandwidth)
    return control.torque(Measured(np.array(q), np.array(v)), reference)


def still(*q: float) -> Reference:
    return Reference(np.array(q), np.zeros(2), np.zeros(2))


def reference_of(node: ControllerNode, stamp: int) -> np.ndarray:
    """Position, velocity and acceleration that the node follows, shape (3, 2)."""
    found = node.follower.reference(stamp)
    return np.array([found.q, found.v, found.a])


def test_holds_where_it_first_sees_the_arm(node: ControllerNode) -> None:
    first = (0.1, -0.2)
    assert_close(effort(node, 0, first), DYNAMICS.gravity(np.array(first)), ALGEBRA)
    later = (0.15, -0.3), (0.5, 0.2)
    assert_close(effort(node, MS, *later), wanted(*later, still(*first)), ALGEBRA)


def test_answers_bear_the_stamp_of_the_state_and_all_names(node: ControllerNode) -> None:
    stamp = 12_345_678_901
    answer = deserialize_message(node.on_joint_states(state(stamp)), JointState)
    assert answer.header.stamp.sec * 10**9 + answer.header.stamp.nanosec == stamp
    assert answer.name == NAMES
    assert len(answer.position) == len(answer.velocity) == 0


def test_answers_over_the_wire(ros: Ros, node: ControllerNode) -> None:
    heard = ros.listen(JointState, "/joint_commands")
    publisher = ros.publisher(JointState, "/joint_states")
    message = JointState(name=["hand", *NAMES[::-1]], position=[9.0, -0.2, 0.1])
    message.velocity = [9.0, 0.0, 0.0]
    publisher.publish(message)
    ros.spin_until(lambda: heard)
    assert_close(heard[0].effort, DYNAMICS.gravity(np.array([0.1, -0.2])), ALGEBRA)


def test_follows_a_trajectory_in_the_time_of_the_stamps(node: ControllerNode) -> None:
    start = 5_000 * MS
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


def test_trajectory_goes_by_joint_name(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(1.0, 0.2, 0.4), names=NAMES[::-1]))
    assert_close(reference_of(node, 1000 * MS)[0], [0.4, 0.2], ALGEBRA)


def test_joints_that_a_trajectory_does_not_name_stay(node: ControllerNode) -> None:
    effort(node, 0, (0.3, -0.4))
    node.on_joint_trajectory(trajectory(point(1.0, 0.7), names=NAMES[1:]))
    for stamp in (0, 500 * MS, 1000 * MS):
        assert_close(reference_of(node, stamp)[:, 0], [0.3, 0.0, 0.0], ALGEBRA)
    assert_close(reference_of(node, 1000 * MS)[0], [0.3, 0.7], ALGEBRA)


def test_given_velocities_and_accelerations_are_met(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    middle = point(1.0, 0.5, 0.5, velocities=[0.3, 0.4], accelerations=[0.1, -0.1])
    node.on_joint_trajectory(trajectory(middle, point(2.0, 1.0, 1.0)))
    assert_close(reference_of(node, 1000 * MS), [[0.5, 0.5], [0.3, 0.4], [0.1, -0.1]], ALGEBRA)


def test_replacement_in_motion_does_not_jump(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(1.0, 1.0, 1.0)))
    before = effort(node, 400 * MS, (0.3, 0.3), (0.5, 0.5))
    node.on_joint_trajectory(trajectory(point(1.0, -1.0, 0.5)))
    assert_close(effort(node, 400 * MS, (0.3, 0.3), (0.5, 0.5)), before, ALGEBRA)
    assert_close(reference_of(node, 1400 * MS)[0], [-1.0, 0.5], ALGEBRA)


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


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (trajectory(), "none of 0 waypoints"),
        (trajectory(point(0.0, 1.0, 1.0)), "none of 1 waypoints lies in the future"),
        (trajectory(point(1.0, 1.0)), "positions of point 0 has 1 numbers; allowed is 2"),
        (trajectory(point(1.0)), "positions of point 0 has 0 numbers"),
        (trajectory(point(1.0, 1.0, np.nan)), "nan"),
        (trajectory(point(1.0, 1.0, 1.0), point(1.0, 2.0, 2.0)), "rising"),
        (trajectory(point(2.0, 1.0, 1.0), point(1.0, 2.0, 2.0)), "rising"),
        (trajectory(point(1.0, 1.0, 1.0, velocities=[1.0])), "velocities of point 0 has 1"),
        (trajectory(point(1.0, 1.0, 1.0, velocities=[1.0, 1.0])), "last waypoint"),
        (trajectory(point(1.0, 1.0, 1.0, accelerations=[np.inf] * 2)), "inf"),
        (trajectory(point(1.0, 1.0), names=["nobody"]), "joint names are nobody; allowed are"),
        (trajectory(point(1.0, 1.0, 1.0), names=[NAMES[0]] * 2), "each once"),
        (trajectory(point(1.0), names=[]), "no joint names"),
    ],
)
def test_bad_trajectory_is_refused_once_and_the_old_one_goes_on(
    node: ControllerNode,
    message: JointTrajectory,
    complaint: str,
    capfd: pytest.CaptureFixture[str],
) -> None:
    effort(node, 0, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(1.0, 1.0, -1.0)))
    before = reference_of(node, 300 * MS)
    capfd.readouterr()
    node.on_joint_trajectory(message)
    said = capfd.readouterr().err
    assert said.count("trajectory refused, the one before goes on") == 1
    assert complaint in said
    np.testing.assert_array_equal(reference_of(node, 300 * MS), before)


def test_trajectory_over_the_wire(ros: Ros, node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    publisher = ros.publisher(JointTrajectory, "/controller/joint_trajectory")
    publisher.publish(trajectory(point(1.0, 0.3, 0.3)))
    ros.spin_until(lambda: node.follower.remaining(0) > 0.0)
    assert_close(reference_of(node, 1000 * MS)[0], [0.3, 0.3], ALGEBRA)


def test_trajectory_before_any_state_is_refused(
    node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    node.on_joint_trajectory(trajectory(point(1.0, 1.0, 1.0)))
    assert "no joint state has been seen yet" in capfd.readouterr().err


def test_time_that_goes_backwards_means_hold_again(node: ControllerNode) -> None:
    effort(node, 9_000 * MS, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(1.0, 1.0, -1.0)))
    here = (0.4, 0.3)
    assert_close(effort(node, 0, here), DYNAMICS.gravity(np.array(here)), ALGEBRA)
    assert_close(reference_of(node, 500 * MS), [here, (0, 0), (0, 0)], ALGEBRA)


@pytest.mark.parametrize(
    "raw",
    [
        b"rubbish",
        serialize_message(JointState(name=NAMES, position=[0.0, 0.0])),
        serialize_message(JointState(name=NAMES[:1], position=[0.0], velocity=[0.0])),
        serialize_message(JointState(name=NAMES, position=[0.0, np.nan], velocity=[0.0] * 2)),
    ],
)
def test_useless_states_get_no_answer(
    node: ControllerNode, raw: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    assert node.on_joint_states(raw) is None
    assert "joint state passed over" in capfd.readouterr().err
    assert node.on_joint_states(state(0)) is not None


def test_a_torque_that_is_not_finite_is_not_sent(
    node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    assert node.on_joint_states(state(0, v=(1e200, 1e200))) is None
    assert "would not be finite" in capfd.readouterr().err
    assert node.on_joint_states(state(MS)) is not None


def test_gains_may_change_while_it_runs(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    off = (0.1, 0.1)
    gains = Parameter("bandwidth", value=[30.0, 5.0])
    assert node.set_parameters([gains])[0].successful
    exact = wanted(off, (0, 0), still(0.0, 0.0), [30.0, 5.0])
    assert_close(effort(node, MS, off), exact, ALGEBRA)
    for bad in (-1.0, [-1.0], [1.0, 2.0, 3.0], [float("nan")], "fast", ["fast", "faster"]):
        result = node.set_parameters([Parameter("bandwidth", value=bad)])[0]
        assert not result.successful
        assert "bandwidth" in result.reason
    assert_close(effort(node, 2 * MS, off), exact, ALGEBRA)


def test_reports_to_whoever_listens(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"), state_period=0.01)
    heard = ros.listen(TrackingState, "/controller/state", 50)
    q, v = np.array([0.3, -0.1]), np.array([0.5, 0.4])
    effort(node, 0, (0.0, 0.0))
    for k in range(1, 31):
        tau = effort(node, k * MS, q, v)
    ros.spin_until(lambda: len(heard) >= 4)
    assert [message.header.stamp.nanosec // MS for message in heard] == [0, 10, 20, 30]
    last = heard[-1]
    assert last.joint_names == NAMES
    for field, exact in {
        "reference_position": [0.0, 0.0],
        "reference_velocity": [0.0, 0.0],
        "reference_acceleration": [0.0, 0.0],
        "feedback_position": q,
        "feedback_velocity": v,
        "position_error": -q,
        "velocity_error": -v,
        "effort": tau,
    }.items():
        np.testing.assert_array_equal(getattr(last, field), exact)


@pytest.mark.parametrize(
    ("parameters", "complaint"),
    [
        ({}, "parameter 'scene' is empty"),
        ({"scene": "nowhere.yaml"}, "nowhere.yaml"),
        ({"scene": str(models.SCENES / "two_link.yaml"), "bandwidth": [-1.0]}, "bandwidth"),
        ({"acceleration_limit": -1.0}, "'acceleration_limit'"),
    ],
)
def test_what_cannot_be_controlled_is_refused_at_start(
    ros: Ros, parameters: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(ArmError, match=complaint):
        ros.add(ControllerNode, **parameters)
