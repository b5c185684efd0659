# SPDX-License-Identifier: Apache-2.0
"""The controller node: its commands for given states."""

from typing import Any

import numpy as np
import pytest
from arm_msgs.msg import TrackingState
from harness import Ros
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from two_link_control import (
    DYNAMICS,
    MS,
    NAMES,
    effort,
    point,
    reference_of,
    state,
    still,
    trajectory,
    wanted,
)

import models
from arm_dynamics import ArmError
from arm_dynamics.ros import ControllerNode
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> ControllerNode:
    """Controls a two-link arm."""
    return ros.add(ControllerNode, models.scene("two_link"), bandwidth=[10.0])


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


@pytest.mark.parametrize(
    "raw",
    [
        b"rubbish",
        serialize_message(JointState(name=NAMES, position=[0.0, 0.0])),
        serialize_message(JointState(name=NAMES[:1], position=[0.0], velocity=[0.0])),
        serialize_message(JointState(name=NAMES, position=[0.0, np.nan], velocity=[0.0] * 2)),
    ],
    ids=["rubbish", "no velocity", "one joint", "nan"],
)
def test_useless_states_get_no_answer(
    node: ControllerNode, raw: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    assert node.on_joint_states(raw) is None
    assert "joint state ignored" in capfd.readouterr().err
    assert node.on_joint_states(state(0)) is not None


@pytest.mark.parametrize("v", [(), (float("nan"), 0.0)], ids=["none", "nan"])
def test_a_robot_without_velocities_is_told_what_helps(
    node: ControllerNode, v: tuple[float, ...], capfd: pytest.CaptureFixture[str]
) -> None:
    assert node.on_joint_states(state(0, v=v)) is None
    assert "'velocities: positions' derives them" in capfd.readouterr().err


def test_a_jump_ends_what_velocities_are_derived_from(ros: Ros) -> None:
    given = {"velocities": "positions", "velocity_cutoff": 0.0, "bandwidth": [10.0]}
    node = ros.add(ControllerNode, models.scene("two_link"), **given)
    effort(node, 0, (0.1, -0.2), ())
    moving = (0.102, -0.201), (2.0, -1.0)
    found = effort(node, MS, moving[0], ())
    assert_close(found, wanted(*moving, still(0.1, -0.2)), 1e-8)
    there = (1.5, -0.2)
    assert_close(effort(node, 2 * MS, there, ()), DYNAMICS.gravity(np.array(there)), ALGEBRA)


def test_a_torque_that_is_not_finite_is_not_sent(
    node: ControllerNode, capfd: pytest.CaptureFixture[str]
) -> None:
    assert node.on_joint_states(state(0, v=(1e200, 1e200))) is None
    assert "would not be finite" in capfd.readouterr().err
    assert node.on_joint_states(state(MS)) is not None


def test_gains_may_change_while_it_runs(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    off = (0.1, 0.1)
    assert_close(effort(node, MS, off), wanted(off, (0, 0), still(0.0, 0.0)), ALGEBRA)
    gains = Parameter("bandwidth", value=[30.0, 5.0])
    assert node.set_parameters([gains])[0].successful
    exact = wanted(off, (0, 0), still(0.0, 0.0), [30.0, 5.0])
    assert_close(effort(node, MS, off), exact, ALGEBRA)
    for bad in (-1.0, [-1.0], [1.0, 2.0, 3.0], [float("nan")], "fast", ["fast", "faster"]):
        result = node.set_parameters([Parameter("bandwidth", value=bad)])[0]
        assert not result.successful
        assert "bandwidth" in result.reason
    assert_close(effort(node, 2 * MS, off), exact, ALGEBRA)


def test_publishes_its_state(ros: Ros) -> None:
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
        "reference_position": [0.0, 0.0], "reference_velocity": [0.0, 0.0],
        "reference_acceleration": [0.0, 0.0], "feedback_position": q, "feedback_velocity": v,
        "position_error": -q, "velocity_error": -v, "effort": tau,
    }.items():  # fmt: skip
        np.testing.assert_array_equal(getattr(last, field), exact)


def test_the_first_state_after_time_went_backwards_is_reported_at_once(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"), state_period=10.0)
    heard = ros.listen(TrackingState, "/controller/state", 50)
    for stamp in (5_000, 5_001, 5_500, 100, 101):
        effort(node, stamp * MS, (0.0, 0.0))
    ros.spin_until(lambda: len(heard) >= 2)
    stamps = [10**9 * m.header.stamp.sec + m.header.stamp.nanosec for m in heard]
    assert stamps == [5_000 * MS, 100 * MS]


def test_a_gap_between_states_means_hold_again_unless_any_gap_is_allowed(ros: Ros) -> None:
    for limit, held in ((0.5, True), (2.0, False), (0.0, False)):
        node = ros.add(ControllerNode, models.scene("two_link"), gap_limit=limit)
        effort(node, 0, (0.0, 0.0))
        node.on_joint_trajectory(trajectory(point(4.0, 1.0, -1.0)))
        effort(node, 1000 * MS, (0.1, 0.2))
        assert (node.goals.follower.remaining(1000 * MS) == 0.0) == held
        assert_close(reference_of(node, 1000 * MS)[0], (0.1, 0.2), ALGEBRA) if held else None


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
