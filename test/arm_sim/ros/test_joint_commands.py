# SPDX-License-Identifier: Apache-2.0
"""Efforts, velocities and positions on joint_commands, mixed and by some joints."""

from __future__ import annotations

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, by_hand, command, ticks

import models
from arm_dynamics.ros.interfaces import STEP
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros

NAN = float("nan")


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A Panda whose ticks are triggered by hand, with its brakes on."""
    return by_hand(ros, "panda", stale_policy="brake")


def names(node: SimNode) -> list[str]:
    return list(node.simulator.joint_names)


def test_by_name_in_any_order_and_some_joints_only(node: SimNode) -> None:
    """Joints that were never commanded get no effort; others keep their last command."""
    every, start = names(node), node.simulator.state.q.copy()
    node.inputs.on_joint_commands(command(name=every, position=start.tolist()))
    ticks(node, 10)
    chosen = [every[6], every[0]]
    node.inputs.on_joint_commands(command(name=chosen, position=[start[6] + 0.02, 0.03]))
    ticks(node, 400)
    wanted = [0.03, *start[1:6], start[6] + 0.02]
    np.testing.assert_allclose(node.simulator.state.q, wanted, atol=1e-9)


@pytest.mark.parametrize("kind", ["position", "effort"])
def test_a_first_command_of_some_joints_names_the_others(
    node: SimNode, kind: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """The brakes of all are released."""
    for joint in names(node)[:2]:
        node.inputs.on_joint_commands(command(name=[joint], **{kind: [0.0]}))
        node.tick()
    told = capfd.readouterr().err
    assert told.count("have no command yet") == 1
    assert "joints panda_joint2, " in told and "panda_joint1" not in told


def test_efforts_between_positions(node: SimNode) -> None:
    every, start = names(node), node.simulator.state.q.tolist()
    node.inputs.on_joint_commands(command(name=every, position=start))
    node.inputs.on_joint_commands(command(name=[every[6]], effort=[0.25]))
    node.tick()
    assert node.simulator.effort[6] == 0.25
    assert abs(node.simulator.effort[1]) > 1.0  # holds against its weight
    node.inputs.on_joint_commands(command(name=every, effort=[0.5] * 7))
    node.tick()
    np.testing.assert_array_equal(node.simulator.effort, 0.5)


def test_what_is_nan_is_not_commanded(node: SimNode) -> None:
    """As the hardware of ros2_control sends what no controller has claimed."""
    every, start = names(node), node.simulator.state.q.copy()
    node.inputs.on_joint_commands(command(name=every, position=[NAN] * 7, effort=[NAN] * 7))
    ticks(node, 20)
    np.testing.assert_array_equal(node.simulator.state.q, start)
    assert node.engine.held == "brakes"
    assert node.inputs.refused == 0
    mixed = {"position": [*start[:6], NAN], "effort": [NAN] * 6 + [0.1]}
    node.inputs.on_joint_commands(command(name=every, **mixed))
    node.tick()
    assert node.simulator.effort[6] == 0.1


def test_after_a_reset_nothing_of_before_is_left(node: SimNode) -> None:
    every, start = names(node), node.simulator.state.q.copy()
    node.inputs.on_joint_commands(command(name=every, position=(start + 0.1).tolist()))
    ticks(node, 50)
    node.engine.reset()
    node.inputs.on_joint_commands(command(name=[every[0]], position=[0.0]))
    node.tick()
    np.testing.assert_array_equal(node.simulator.effort[1:], 0.0)


def test_an_effort_beside_a_position_is_added_within_limits(
    node: SimNode, capfd: pytest.CaptureFixture[str]
) -> None:
    start = node.simulator.state.q.tolist()
    efforts = [1000.0] + [NAN] * 6
    node.inputs.on_joint_commands(command(name=names(node), position=start, effort=efforts))
    node.tick()
    assert node.simulator.effort[0] == node.simulator.model.effort_limit[0]
    assert "command 1000 N m of joint 'panda_joint1' exceeds its limit" in capfd.readouterr().err


def test_two_sources_lead_joints_by_position_and_by_effort(ros: Ros) -> None:
    node = by_hand(ros)
    left = JointState(name=[NAMES[0]], position=[node.simulator.state.q[0]])
    right = JointState(name=[NAMES[1]], effort=[0.3])
    left.header.frame_id, right.header.frame_id = "left", "right"
    for _ in range(50):
        for message in (left, right):
            node.inputs.on_joint_commands(serialize_message(message))
        node.tick()
    assert node.simulator.effort[1] == 0.3
    assert abs(node.simulator.state.q[0] - models.simulator("two_link").state.q[0]) < 1e-2
    assert set(node.engine.arbiter.sources) == {"left", "right"}


def test_who_commands_nothing_owns_nothing(ros: Ros) -> None:
    """Hardware that no controller has claimed, beside one that leads; and two that lead."""
    node = by_hand(ros)
    start = node.simulator.state.q.tolist()
    for _ in range(20):
        node.inputs.on_joint_commands(command(name=list(NAMES), position=[NAN, NAN]))
    leader = JointState(name=list(NAMES), position=start)
    leader.header.frame_id = "leader"
    for _ in range(20):
        node.inputs.on_joint_commands(serialize_message(leader))
        node.tick()
    assert node.inputs.refused == 0
    node.inputs.on_joint_commands(command(name=list(NAMES), position=[0.0, 0.0]))
    assert node.inputs.refused == 1
    node.tick()
    assert abs(node.simulator.state.q - start).max() < 1e-9


def test_steps_of_a_paused_simulation_wait_for_the_servos(ros: Ros) -> None:
    """In a node that ticks by the clock they are built in the background."""
    node = ros.add(SimNode, models.scene("two_link"), paused=True)
    goal = node.simulator.state.q + 0.01
    message = JointState(name=list(NAMES), position=goal.tolist())
    node.inputs.on_joint_commands(serialize_message(message))
    request = STEP.type.Request(steps=300)
    assert node.requests.answer(STEP, request).success
    np.testing.assert_allclose(node.simulator.state.q, goal, atol=1e-8)
