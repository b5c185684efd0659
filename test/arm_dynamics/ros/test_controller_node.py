# SPDX-License-Identifier: Apache-2.0
"""The controller node: commands for states, how it follows trajectories, and what are jumps."""

import time
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest
from arm_msgs.msg import TrackingState
from harness import Ros
from rclpy.parameter import Parameter
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
from arm_dynamics.control.controller import Measured
from arm_dynamics.logs import Throttled
from arm_dynamics.ros import ControllerNode
from arm_dynamics.ros.controller.goals import Goal, Goals
from arm_dynamics.ros.controller.jumps import Jumps
from arm_dynamics.trajectory import Limits, Reference
from arm_dynamics.trajectory.follower import Outset
from arm_dynamics.trajectory.reference import Motion
from arm_dynamics.trajectory.trajectory import hold
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


def test_answers_over_the_wire(ros: Ros, node: ControllerNode) -> None:
    """With the stamp of the state, whatever else it tells of."""
    heard = ros.listen(JointState, "/joint_commands")
    publisher = ros.publisher(JointState, "/joint_states")
    message = JointState(name=["hand", *NAMES[::-1]], position=[9.0, -0.2, 0.1])
    message.velocity = [9.0, 0.0, 0.0]
    message.header.stamp.sec, message.header.stamp.nanosec = 12, 345_678_901
    publisher.publish(message)
    ros.spin_until(lambda: heard)
    assert heard[0].header.stamp == message.header.stamp and heard[0].name == NAMES
    assert_close(heard[0].effort, DYNAMICS.gravity(np.array([0.1, -0.2])), ALGEBRA)


@pytest.mark.parametrize(
    ("raw", "said"),
    [
        (b"rubbish", "joint state ignored: 7 bytes are not a JointState"),
        (state(0, v=(np.nan, 0.0)), "'velocities: positions' derives them"),
        (state(0, v=()), "'velocities: positions' derives them"),
        (state(0, v=(0.0,)), "velocity has 1 numbers for 2 joints; allowed: one for each name\n"),
    ],
    ids=["rubbish", "nan", "empty", "too few"],
)
def test_useless_states_get_no_answer(
    node: ControllerNode, raw: bytes, said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert node.on_joint_states(raw) is None
    assert said in capfd.readouterr().err
    assert node.on_joint_states(state(0)) is not None


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
    assert "would not be finite" in node.diagnostics()[0].message(node).message
    assert node.on_joint_states(state(MS)) is not None and not node._log.failure


def test_gains_may_change_while_it_runs(node: ControllerNode) -> None:
    effort(node, 0, (0.0, 0.0))
    off = (0.1, 0.1)
    assert_close(effort(node, MS, off), wanted(off, (0, 0), still(0.0, 0.0)), ALGEBRA)
    gains = Parameter("bandwidth", value=[30.0, 5.0])
    assert node.set_parameters([gains])[0].successful
    exact = wanted(off, (0, 0), still(0.0, 0.0), [30.0, 5.0])
    assert_close(effort(node, MS, off), exact, ALGEBRA)


def test_publishes_its_state(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"), state_period=0.01)
    heard = ros.listen(TrackingState, "/controller/state", 50)
    q, v = np.array([0.3, -0.1]), np.array([0.5, 0.4])
    effort(node, 0, (0.0, 0.0))
    for k in range(1, 31):
        tau = effort(node, k * MS, q, v)
    effort(node, 15 * MS, q, v)  # time goes backwards, which is told at once
    ros.spin_until(lambda: len(heard) >= 5)
    assert [message.header.stamp.nanosec // MS for message in heard] == [0, 10, 20, 30, 15]
    last = heard[3]
    assert last.joint_names == NAMES
    for field, exact in {
        "reference_position": [0.0, 0.0], "reference_velocity": [0.0, 0.0],
        "reference_acceleration": [0.0, 0.0], "feedback_position": q, "feedback_velocity": v,
        "position_error": -q, "velocity_error": -v, "effort": tau,
    }.items():  # fmt: skip
        np.testing.assert_array_equal(getattr(last, field), exact)


def test_a_gap_between_states_means_hold_again_unless_any_gap_is_allowed(ros: Ros) -> None:
    for limit, held in ((0.5, True), (2.0, False), (0.0, False)):
        node = ros.add(ControllerNode, models.scene("two_link"), gap_limit=limit)
        effort(node, 0, (0.0, 0.0))
        node.on_joint_trajectory(trajectory(point(4.0, 1.0, -1.0)))
        effort(node, 1000 * MS, (0.1, 0.2))
        assert (node.goals.follower.remaining(1000 * MS) == 0.0) == held
        assert_close(reference_of(node, 1000 * MS)[0], (0.1, 0.2), ALGEBRA) if held else None


def test_what_cannot_be_controlled_is_refused_at_start(ros: Ros) -> None:
    with pytest.raises(ArmError, match="bandwidth"):
        ros.add(ControllerNode, scene=str(models.SCENES / "two_link.yaml"), bandwidth=[-1.0])


def test_follows_a_trajectory_in_the_time_of_the_stamps(node: ControllerNode) -> None:
    start = 1_700_000_000_123_456_789  # of a system's clock
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


def test_limits_slow_it_down(ros: Ros) -> None:
    node = ros.add(ControllerNode, models.scene("two_link"), acceleration_limit=5.0)
    effort(node, 0, (0.0, 0.0))
    node.on_joint_trajectory(trajectory(point(0.1, 0.5, -0.5)))
    assert "times slower for the limits" in node.goals.outcome
    moving = np.array([reference_of(node, k * MS) for k in range(2000)])
    assert np.abs(moving[:, 2]).max() == pytest.approx(5.0, rel=1e-4)
    assert_close(moving[-1, 0], [0.5, -0.5], ALGEBRA)


BAD = (
    (trajectory(), "no waypoint lies in the future"),
    (trajectory(point(1.0, 1.0)), "positions of point 0 has 1 numbers; allowed: 2"),
    (trajectory(point(1.0, 1.0, np.nan)), f"positions of point 0, joint '{NAMES[1]}', is nan"),
    (trajectory(point(1.0, 1.0, 1.0, velocities=[1.0])), "velocities of point 0 has 1"),
    (trajectory(point(1.0, 1.0), names=["nobody"]), "unknown joints nobody; allowed: "),
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


def test_goals_that_the_log_withholds_are_counted() -> None:
    now, said = [0.0], list[str]()
    log = Throttled(SimpleNamespace(error=said.append), lambda: now[0])
    goals = Goals(DYNAMICS.model, Limits.of(DYNAMICS.model), log)
    for k in range(15):  # ten of them are logged
        goals.refuse("goal", f": there is no joint nobody{k}")
    now[0] = 60.0
    goals.log_unlogged()
    assert said[-1].startswith("5 more goals refused since") and len(said) == 11


def test_a_state_that_comes_again_is_answered_for_the_new_motion(node: ControllerNode) -> None:
    """As in lockstep, where the first state waits until the robot is told to move."""
    before = effort(node, 0, (0.0, 0.0))
    assert_close(effort(node, 0, (0.0, 0.0)), before, ALGEBRA)
    pushed = [point(t, 0.1, 0.1, effort=[3.0, 4.0]) for t in (0.0, 1.0)]
    node.on_joint_trajectory(trajectory(*pushed))
    assert_close(effort(node, 0, (0.0, 0.0)) - before, [3.0, 4.0], ALGEBRA)


NOW = 1_700_000_000 * 1000 * MS  # a stamp of a system's clock


def at(*q: float, speed: float = 0.0) -> Measured:
    return Measured(np.array(q), np.full(len(q), speed))


@pytest.mark.parametrize(
    ("gap", "state", "said"),
    [
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


def test_the_longest_time_between_states_is_known_and_zero_allows_any_jump() -> None:
    jumps, stamp = Jumps(["a", "b"]), NOW
    for gap in (0, 1, 30, 2, 5000, 3):  # the last but one is a jump
        jumps.detect(stamp := stamp + gap * MS, at(0.0, 0.0), 1.0, 0.5)
    assert_close(jumps.take_longest(), 0.03, ALGEBRA)
    assert not jumps.detect(stamp + MS, at(9.0, 9.0), 0.0, 0.0)


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
    effort(node, NOW, (1.3, 0.4))  # a jump at rest ends no motion
    assert "moved by 1.2" in node.goals.outcome


def test_a_jump_ends_what_is_being_planned(ros: Ros) -> None:
    node, ready = ros.add(ControllerNode, models.scene("two_link")), Event()
    effort(node, NOW, (0.1, -0.2))

    def plan(outset: Outset) -> Motion:
        ready.wait(20.0)
        return hold(outset.reference.q + 0.1)

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
