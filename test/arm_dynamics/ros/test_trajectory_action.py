# SPDX-License-Identifier: Apache-2.0
"""The action FollowJointTrajectory, by the rules of joint_trajectory_controller."""

from threading import Event
from typing import Any

import numpy as np
import own_controllers
import pytest
from goal_client import ABORTED, CANCELED, SUCCEEDED, Client, Result, goal, led, tolerance
from harness import Ros, change
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from two_link_control import MS, NAMES, effort, point, reference_of, state, trajectory

import models
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.controller import trajectory_action
from arm_dynamics.trajectory import Reference
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
from tolerances import ALGEBRA, assert_close

pytestmark = pytest.mark.ros
HERE = (0.1, -0.2)


@pytest.fixture
def node(ros: Ros) -> ControllerNode:
    """Controls a two-link arm that rests."""
    made = ros.add(ControllerNode, models.scene("two_link"))
    effort(made, 0, HERE)
    return made


@pytest.fixture
def client(ros: Ros, node: ControllerNode) -> Client:
    return Client(ros)


def moved(*step: float) -> list[float]:
    return [float(q + dq) for q, dq in zip(HERE, step, strict=True)]


def to(*step: float, time: float = 1.0, **more: Any) -> Any:
    """A goal of one point with velocity zero, some way from here."""
    return goal(trajectory(point(time, *moved(*step), velocities=[0.0, 0.0])), **more)


def test_a_goal_is_followed_and_reached(node: ControllerNode, client: Client) -> None:
    handle = client.send(to(0.4, -0.3))
    assert handle.accepted
    led(node, 0, 1000)
    status, result = client.result(handle)
    assert (status, result.error_code) == (SUCCEEDED, Result.SUCCESSFUL)
    assert result.error_string == "Goal successfully reached!"
    assert_close(reference_of(node, 5000 * MS)[0], moved(0.4, -0.3), ALGEBRA)


def test_an_arm_that_is_stopped_keeps_the_efforts_it_had(
    node: ControllerNode, client: Client
) -> None:
    efforts = [point(t, *moved(0.1 * t, 0.0), effort=[2.0, -1.0]) for t in (0.0, 2.0)]
    handle = client.send(goal(trajectory(*efforts), path_tolerance=[tolerance(NAMES[1], 0.05)]))
    led(node, 0, 500)
    assert_close(node.goals.follower.reference(500 * MS).tau, [2.0, -1.0], ALGEBRA)
    led(node, 501, 501, off=lambda _: (0.0, 0.06))
    client.result(handle)
    for stamp in (502 * MS, 3000 * MS):
        assert_close(node.goals.follower.reference(stamp).tau, [2.0, -1.0], ALGEBRA)


def test_feedback_says_where_the_arm_is_and_should_be(
    ros: Ros, node: ControllerNode, client: Client
) -> None:
    """As often as it shall, although every state is compared with a tolerance."""
    client.send(to(0.4, -0.4, path_tolerance=[tolerance(NAMES[1], 0.05)]))
    for k in range(10):
        led(node, 50 * k, 50 * k + 49, off=lambda stamp: (0.01, -0.02), step=7)
        ros.spin_until(lambda count=k: len(client.feedback) > count)  # 20 Hz
    assert len(client.feedback) == 10
    for k, message in enumerate(client.feedback):
        assert list(message.joint_names) == NAMES
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == (0, 50 * MS * k)
        at = 0.05 * k
        exact = np.array(HERE) + np.array([0.4, -0.4]) * (3 * at**2 - 2 * at**3)
        assert_close(message.desired.positions, exact, ALGEBRA)
        assert_close(message.error.positions, [0.01, -0.02], ALGEBRA)
        assert_close(message.actual.positions, exact - [0.01, -0.02], ALGEBRA)
        assert_close(message.actual.velocities, message.desired.velocities, ALGEBRA)
        assert message.desired.time_from_start.nanosec == 50 * MS * k


@pytest.mark.parametrize("value", [0.05, 0.0], ids=["its own", "the default"])
def test_a_violated_path_tolerance_aborts_and_holds(
    node: ControllerNode, client: Client, value: float
) -> None:
    assert change(node, **{f"constraints.{NAMES[1]}.trajectory": 0.05}).successful
    handle = client.send(to(0.4, 0.4, path_tolerance=[tolerance(NAMES[1], value)]))
    led(node, 0, 490)
    led(node, 500, 500, off=lambda _: (0.2, 0.06))  # the shoulder has no tolerance
    status, result = client.result(handle)
    assert (status, result.error_code) == (ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    assert result.error_string == "Aborted due to path tolerance violation"
    there = reference_of(node, 500 * MS)
    assert_close(there[0], np.array(moved(0.2, 0.2)) - [0.2, 0.06], ALGEBRA)  # where the arm is
    assert not reference_of(node, 800 * MS)[1:].any()
    assert np.abs(reference_of(node, 800 * MS)[0] - there[0]).max() < 0.11  # v T / 2


@pytest.mark.parametrize("by_goal", [True, False], ids=["of the goal", "the default"])
def test_a_goal_time_ends_the_wait(node: ControllerNode, client: Client, by_goal: bool) -> None:
    assert change(
        node, **{"constraints.goal_time": 0.5, f"constraints.{NAMES[0]}.goal": 0.01}
    ).successful
    own = {"within": 0.5, "goal_tolerance": [tolerance(NAMES[0], 0.01)]} if by_goal else {}
    handle = client.send(to(0.4, 0.4, **own))
    led(node, 0, 1510, off=lambda _: (0.02, 0.0))
    status, result = client.result(handle)
    assert (status, result.error_code) == (ABORTED, Result.GOAL_TOLERANCE_VIOLATED)
    assert result.error_string == (
        "Aborted due to goal_time_tolerance exceeding by 0.510000 seconds"
    )
    assert_close(reference_of(node, 3000 * MS)[0], moved(0.38, 0.4), ALGEBRA)


def test_cancelled_it_comes_to_rest_and_holds(node: ControllerNode, client: Client) -> None:
    handle = client.send(to(0.4, 0.4))
    led(node, 0, 500)
    before = reference_of(node, 500 * MS)
    assert client.cancel(handle) == 1
    status, result = client.result(handle)
    assert (status, result.error_code, result.error_string) == (CANCELED, 0, "")
    assert node.goals.outcome == "action goal cancelled, the arm is held"
    assert_close(reference_of(node, 500 * MS)[:2], before[:2], ALGEBRA)  # no jump
    held = before[0] + 0.5 * 0.2 * before[1]
    assert_close(reference_of(node, 700 * MS), [held, [0, 0], [0, 0]], ALGEBRA)


def test_a_new_goal_takes_over_from_where_the_reference_is(
    node: ControllerNode, client: Client
) -> None:
    first = client.send(to(0.4, 0.4))
    led(node, 0, 500)
    before = reference_of(node, 500 * MS)
    second = client.send(to(-0.4, 0.4))
    status, result = client.result(first)
    assert (status, result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert result.error_string == "Current goal preempted by new incoming action."
    assert_close(reference_of(node, 500 * MS)[:2], before[:2], ALGEBRA)
    led(node, 500, 1500)
    assert client.result(second)[0] == SUCCEEDED
    assert_close(reference_of(node, 1500 * MS)[0], moved(-0.4, 0.4), ALGEBRA)


def test_a_trajectory_on_the_topic_ends_the_goal(node: ControllerNode, client: Client) -> None:
    handle = client.send(to(0.4, 0.4))
    led(node, 0, 500)
    node.on_joint_trajectory(trajectory(point(1.0, *HERE)))
    led(node, 510, 510)
    status, result = client.result(handle)
    assert (status, result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert result.error_string == "Current goal cancelled due to new incoming trajectory."


def test_a_goal_that_is_replaced_before_its_acceptance_is_out_is_aborted(
    node: ControllerNode, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = node.action._begin

    def begun(*given: Any) -> None:
        begin(*given)
        node.on_joint_trajectory(trajectory(point(1.0, *HERE)))

    monkeypatch.setattr(node.action, "_begin", begun)
    status, result = client.result(client.send(to(0.4, 0.4)))
    assert (status, result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert node.action.active is None


def test_states_whose_time_goes_backwards_end_the_goal(
    node: ControllerNode, client: Client
) -> None:
    effort(node, 100 * MS, HERE)
    handle = client.send(to(0.4, 0.4))
    effort(node, 50 * MS, (0.5, 0.5))
    status, result = client.result(handle)
    assert (status, result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert "held where it is" in result.error_string
    assert_close(reference_of(node, 2000 * MS)[0], [0.5, 0.5], ALGEBRA)


def stamped(wanted: Any, seconds: float) -> Any:
    stamp = wanted.trajectory.header.stamp
    stamp.sec, stamp.nanosec = divmod(round(1e9 * seconds), 10**9)
    return wanted


def test_a_stamp_ahead_delays_the_start(ros: Ros, node: ControllerNode, client: Client) -> None:
    """Until then neither is the path checked nor feedback given."""
    near = {"path_tolerance": [tolerance(NAMES[1], 0.05)]}
    handle = client.send(stamped(to(0.4, 0.4, **near), 2.0))
    led(node, 0, 1990, off=lambda _: (0.0, 0.06), step=10)
    for _ in range(5):
        ros.spin_once()
    assert not client.feedback
    assert_close(reference_of(node, 2000 * MS)[0], HERE, ALGEBRA)
    assert_close(reference_of(node, 2500 * MS)[0], moved(0.2, 0.2), ALGEBRA)
    led(node, 2000, 3000)
    assert client.result(handle)[0] == SUCCEEDED


def test_points_that_are_over_are_left_out(ros: Ros, node: ControllerNode, client: Client) -> None:
    effort(node, 1000 * MS, HERE)
    points = trajectory(point(0.2, *moved(-0.2, 0.0)), point(1.5, *moved(0.4, 0.0)))
    assert client.send(stamped(goal(points), 0.5)).accepted  # a second from here to the last one
    assert_close(reference_of(node, 1500 * MS)[:2, 0], [0.3, 0.4], ALGEBRA)
    assert_close(reference_of(node, 2000 * MS)[0], moved(0.4, 0.0), ALGEBRA)
    led(node, 1600, 1600)
    ros.spin_until(lambda: client.feedback)
    since = client.feedback[0].actual.time_from_start
    assert (since.sec, since.nanosec) == (1, 100 * MS)  # since its stamp


def test_who_is_there_already_needs_no_time(node: ControllerNode, client: Client) -> None:
    handle = client.send(goal(trajectory(point(0.0, *moved(0.005, -0.005)))))
    led(node, 10, 10)
    assert client.result(handle)[0] == SUCCEEDED
    for away in ((0.02, 0.0), (0.0, -0.02)):
        assert not client.send(goal(trajectory(point(0.0, *moved(*away))))).accepted


BAD = {
    "0 points": goal(trajectory()),
    "joints elbow are missing": goal(trajectory(point(1.0, 0.1), names=NAMES[:1])),
    "positions of point 0, joint 'elbow', is nan; allowed: finite": goal(
        trajectory(point(1.0, 0.1, float("nan")))
    ),
    "time_from_start of point 1 is 1 s": goal(trajectory(point(1.0, *HERE), point(1.0, *HERE))),
    "last velocity of joint 'elbow' is 0.1": goal(
        trajectory(point(1.0, *HERE, velocities=[0.0, 0.1]))
    ),
    "names joint nobody": to(0.1, 0.1, path_tolerance=[tolerance("nobody", 0.1)]),
    "names joint 'elbow' twice": to(
        0.1, 0.1, goal_tolerance=[tolerance(NAMES[1], 0.1), tolerance(NAMES[1], velocity=0.1)]
    ),
    "position in goal_tolerance of joint 'elbow' is -0.5": to(
        0.1, 0.1, goal_tolerance=[tolerance(NAMES[1], -0.5)]
    ),
    "have no accelerations": to(0.1, 0.1, path_tolerance=[tolerance(NAMES[1], acceleration=0.1)]),
    "goal_time_tolerance is -0.5": to(0.1, 0.1, within=-0.5),
    "stamps of the same clock": stamped(to(0.1, 0.1), 3700.0),
    "'shoulder' would leave its position limit at 6.8": to(3.2, 0.0, time=9.0),
    "'shoulder' would leave its effort limit at 0.": to(0.8, 0.0, time=0.2),
}  # fmt: skip


def test_a_bad_goal_is_refused_and_the_one_under_way_goes_on(
    node: ControllerNode, client: Client, capfd: pytest.CaptureFixture[str]
) -> None:
    handle = client.send(to(0.4, 0.4))
    led(node, 0, 500)
    capfd.readouterr()
    for k, (complaint, wrong) in enumerate(BAD.items(), 1):
        assert not client.send(wrong).accepted
        assert complaint in node.goals.outcome and node.goals.refused == k
        if k == 1:  # many at once are not all logged
            assert capfd.readouterr().err.count("action goal refused") == 1
    led(node, 500, 1000)
    assert client.result(handle)[0] == SUCCEEDED


def test_partial_goals_are_a_parameter(node: ControllerNode, client: Client) -> None:
    assert change(node, allow_partial_joints_goal=True).successful
    assert client.send(goal(trajectory(point(1.0, 0.5), names=NAMES[1:]))).accepted
    assert_close(reference_of(node, 1000 * MS)[0], [HERE[0], 0.5], ALGEBRA)


def test_stretching_is_a_parameter(node: ControllerNode, client: Client) -> None:
    assert change(node, stretch_goals=True, limit_margin=0.0).successful
    handle = client.send(to(0.0, 2.0, time=0.3))  # 10 rad/s at the peak, where 8 are allowed
    assert handle.accepted
    moving = np.array([reference_of(node, k * MS) for k in range(2000)])
    assert np.abs(moving[:, 1]).max() <= 8.0
    assert_close(moving[-1, 0], moved(0.0, 2.0), ALGEBRA)
    led(node, 0, 2000)
    assert client.result(handle)[0] == SUCCEEDED


def test_a_controller_that_fails_ends_the_goal_and_gets_no_other(
    ros: Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(own_controllers.Fails, "how", "")
    node = ros.add(ControllerNode, models.scene("two_link"), controller="own_controllers:Fails")
    effort(node, 0, HERE)
    client = Client(ros)
    handle = client.send(to(0.4, 0.4))
    monkeypatch.setattr(own_controllers.Fails, "how", "raise")
    assert node.on_joint_states(state(10 * MS, HERE)) is None
    status, result = client.result(handle)
    assert (status, result.error_code) == (ABORTED, Result.INVALID_GOAL)
    assert result.error_string == "Current goal cancelled, the controller failed."
    assert not client.send(to(0.4, 0.4)).accepted
    assert "no commands until it is tuned" in node.goals.outcome


def test_a_goal_that_is_given_up_while_it_is_planned_is_refused(
    ros: Ros, node: ControllerNode, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = Event()

    def plan(_: Any, __: Any, outset: Any) -> Motion:
        go.wait(20.0)
        return hold(outset.reference.q)

    monkeypatch.setattr(node.action, "_plan", plan)
    first = client.begin(goal(trajectory(*[point(0.1 * k, *HERE) for k in range(1, 20)])))
    ros.spin_until(lambda: node.goals.planner.busy)
    node.on_joint_trajectory(trajectory(point(1.0, *HERE)))
    go.set()
    ros.spin_until(first.done)
    assert not first.result().accepted
    assert (
        node.goals.outcome == "action goal refused: a newer goal came while it was being planned"
    )


@pytest.mark.parametrize(
    ("elbow", "speed", "begins", "ends"),
    [(-0.2, 9.0, (-0.2, 9.0), 0.7), (2.7, 2.0, (2.7, 0.0), 2.7), (2.9, 1.0, (2.8, 0.0), 2.8)],
    ids=["faster than allowed", "near its limit", "beyond its limit"],
)
def test_wherever_an_arm_is_stopped_it_ends_within_its_limits(
    node: ControllerNode, elbow: float, speed: float, begins: tuple[float, float], ends: float
) -> None:
    here = Reference(np.array([0.1, elbow]), np.array([0.0, speed]), np.zeros(2))
    node.goals.brake(here)
    assert_close(reference_of(node, 0)[:2, 1], begins, ALGEBRA)
    assert_close(reference_of(node, 5000 * MS)[:, 1], [ends, 0.0, 0.0], ALGEBRA)


def test_a_continuous_joint_goes_the_shorter_way(ros: Ros) -> None:
    """From one turn and 0.1 rad to 0.3 rad: 0.2 rad, and not a turn back."""
    scene = models.scene("kinova")
    node = ros.add(ControllerNode, scene)
    names, q0 = list(node.dynamics.joint_names), np.array(node.dynamics.model.q0)
    turn = next(i for i, k in enumerate(node.dynamics.model.joint_types) if k == "continuous")
    here, there = q0.copy(), q0.copy()
    here[turn], there[turn] = 2.0 * np.pi + 0.1, 0.3
    shown = JointState(name=names, position=here.tolist(), velocity=[0.0] * len(names))
    node.on_joint_states(serialize_message(shown))
    assert Client(ros).send(goal(trajectory(point(2.0, *there), names=names))).accepted
    assert node.goals.follower.reference(2000 * MS).q[turn] == pytest.approx(2.0 * np.pi + 0.3)


def test_without_the_interface_there_is_no_action(
    ros: Ros, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    absent = trajectory_action.ACTION._replace(type=None)
    monkeypatch.setattr(trajectory_action, "ACTION", absent)
    ros.add(ControllerNode, models.scene("two_link"))
    assert "control_msgs is not installed" in capfd.readouterr().err
