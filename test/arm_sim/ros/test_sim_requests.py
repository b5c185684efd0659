# SPDX-License-Identifier: Apache-2.0
"""The sim node's services: pause, step, reset, joint states; what they refuse."""

from typing import Any

import numpy as np
import pytest
from arm_msgs.srv import SetJointState, Step
from diagnostic_msgs.msg import DiagnosticStatus
from harness import Ros
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, TAU, by_hand, motion, next_command, ticks
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

import models
from arm_dynamics.ros.interfaces import PAUSE, RESET, SET_JOINT_STATE, STEP
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm whose ticks are triggered by hand."""
    return by_hand(ros)


def set_joint_state(node: SimNode, **fields: Any) -> Any:
    return node.requests.answer(SET_JOINT_STATE, SetJointState.Request(**fields))


def step(node: SimNode, steps: int) -> Any:
    return node.requests.answer(STEP, Step.Request(steps=steps))


def test_mimic_joints_may_be_set_as_they_follow(ros: Ros) -> None:
    node, both = by_hand(ros, "gripper"), ["right_slide", "left_slide"]
    assert set_joint_state(node, joint_names=both, position=[-0.011, 0.03]).success
    np.testing.assert_array_equal(motion(node), [[0.0, 0.03], [0.0, 0.0]])
    for fields, words in (
        ({"joint_names": both, "velocity": [0.1, 0.1]}, "right_slide is 0.1, but right_slide fol"),
        ({"joint_names": both[:1], "position": [0.0]}, "right_slide follows left_slide; command"),
    ):
        answer = set_joint_state(node, **fields)
        assert not answer.success and words in answer.message
    np.testing.assert_array_equal(motion(node), [[0.0, 0.03], [0.0, 0.0]])


def test_pause_stops_and_releases(node: SimNode, capfd: pytest.CaptureFixture[str]) -> None:
    ticks(node, 3)
    assert node.requests.answer(PAUSE, SetBool.Request(data=True)).success
    before = motion(node)
    ticks(node, 3)
    np.testing.assert_array_equal(motion(node), before)
    assert node.requests.answer(PAUSE, SetBool.Request(data=False)).success
    ticks(node, 3)
    assert node.simulator.arm.step_count == 6
    said = capfd.readouterr().err
    assert "paused at 0.003 s" in said and "running on at 0.003 s" in said


def test_a_paused_arm_is_seen_now_and_then(ros: Ros) -> None:
    node = by_hand(ros, paused=True)
    heard = ros.listen(JointState, "/joint_states", 50)
    ticks(node, 350)
    ros.spin_until(lambda: len(heard) >= 3)
    assert 3 <= len(heard) <= 4
    assert all(message.header.stamp.nanosec == 0 for message in heard)


def test_step_advances_a_paused_simulation_with_the_last_command(ros: Ros) -> None:
    node, sim = by_hand(ros, paused=True, command_timeout=0.002), models.simulator("two_link")
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    answer = step(node, 25)
    assert answer.success, answer.message
    assert answer.time == pytest.approx(0.025)
    for _ in range(25):
        sim.step(TAU)
    np.testing.assert_array_equal(motion(node), [sim.state.q, sim.state.v])


def test_reset_goes_back_to_the_start_without_a_command(ros: Ros, node: SimNode) -> None:
    start = motion(node)
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    ticks(node, 10)
    heard = ros.listen(JointState, "/joint_states")
    assert node.requests.answer(RESET).success
    np.testing.assert_array_equal(motion(node), start)
    assert node.simulator.state.time == 0.0
    np.testing.assert_array_equal(
        next_command(node.engine.commands, node.simulator.state.q), [0.0, 0.0]
    )
    ros.spin_until(lambda: heard)
    assert heard[-1].header.stamp.nanosec == 0


def test_set_joint_state_by_name_while_time_goes_on(ros: Ros, node: SimNode) -> None:
    ticks(node, 10)
    moving = motion(node)
    heard = ros.listen(JointState, "/joint_states")
    answer = set_joint_state(node, joint_names=[NAMES[1]], position=[0.7])
    assert answer.success, answer.message
    np.testing.assert_array_equal(motion(node), [[moving[0, 0], 0.7], [moving[1, 0], 0.0]])
    assert node.simulator.state.time == pytest.approx(0.01)
    ros.spin_until(lambda: heard)
    assert heard[-1].position[1] == 0.7
    assert set_joint_state(node, velocity=[0.1, 0.2]).success
    np.testing.assert_array_equal(motion(node), [[moving[0, 0], 0.7], [0.1, 0.2]])


BAD = [
    ({"position": [1.0]}, "position has 1 numbers; allowed: 2"),
    ({"velocity": [1.0] * 3}, "velocity has 3 numbers; allowed: 2"),
    ({"position": [1.0, np.nan]}, f"joint '{NAMES[1]}', is nan; allowed: finite numbers"),
    ({"velocity": [0.0, 1e17]}, "is 1e+17; allowed: up to 1000 rad/s, 1 rad in a time step"),
    ({"velocity": [-1000.1, 0.0]}, f"velocity of joint '{NAMES[0]}' is -1000.1; allowed: "),
    ({"position": [3.2, 0.0]}, f"'{NAMES[0]}' at 3.2 is beyond its stops; allowed: -3.1 to 3.1"),
    ({"joint_names": ["nobody"], "position": [1.0]}, "unknown joints nobody; allowed: "),
    ({"joint_names": [NAMES[0]] * 2, "position": [1.0] * 2}, "each once"),
]


def test_bad_joint_states_are_refused(node: SimNode) -> None:
    for fields, complaint in BAD:
        ticks(node, 5)
        before = motion(node)
        answer = set_joint_state(node, **fields)
        assert not answer.success
        assert complaint in answer.message
        np.testing.assert_array_equal(motion(node), before)
    assert set_joint_state(node, velocity=[1000.0, -1000.0]).success


def test_divergence_pauses_and_keeps_the_last_good_state(
    node: SimNode, capfd: pytest.CaptureFixture[str]
) -> None:
    ticks(node, 4)
    node.simulator.set_state([0.0, 0.0], [1e160, 1e160])
    good = motion(node)
    ticks(node, 3)
    assert capfd.readouterr().err.count("cannot be computed") == 1
    found = {f.part: f for f in node.diagnostics()}["simulation"]
    assert found.message(node).level == DiagnosticStatus.ERROR and found.values["diverged"]
    answer = step(node, 2)
    assert not answer.success
    assert "after 0 of 2 steps" in answer.message
    ticks(node, 3)
    np.testing.assert_array_equal(motion(node), good)
    node.simulator.set_state([0.0, 0.0], [0.0, 0.0])
    assert node.requests.answer(PAUSE, SetBool.Request(data=False)).success
    ticks(node, 2)
    assert node.simulator.arm.step_count == 6
    found = {f.part: f for f in node.diagnostics()}["simulation"]
    assert found.message(node).level == DiagnosticStatus.OK


def test_by_the_clock_it_ticks_and_serves(ros: Ros) -> None:
    node = ros.add(SimNode, models.scene("two_link"))
    heard = ros.listen(JointState, "/joint_states")
    ros.spin_until(lambda: len(heard) > 50)
    running = ros.call(Step, "/sim/step", Step.Request(steps=1))
    assert not running.success
    assert "paused" in running.message
    assert ros.call(SetBool, "/sim/pause", SetBool.Request(data=True)).success
    count = node.simulator.arm.step_count
    answer = ros.call(Step, "/sim/step", Step.Request(steps=7))
    assert answer.success, answer.message
    assert node.simulator.arm.step_count == count + 7
    request = SetJointState.Request(position=[0.5, 0.5])
    assert ros.call(SetJointState, "/sim/set_joint_state", request).success
    np.testing.assert_array_equal(motion(node), [[0.5, 0.5], [0.0, 0.0]])
    assert ros.call(Trigger, "/sim/reset", Trigger.Request()).success
    assert node.simulator.arm.step_count == 0
