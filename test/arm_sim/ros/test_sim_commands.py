# SPDX-License-Identifier: Apache-2.0
"""What commands do to the sim node, ticked by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, TAU, Waiting, by_hand, command, motion, ticks
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

import models
from arm_dynamics.ros.common.convert import to_time
from arm_sim.ros.sim_node import SimNode

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm that ticks when told to."""
    return by_hand(ros)


def acting(node: SimNode) -> np.ndarray:
    """The torque of the next tick."""
    return node.commands.held(node.simulator.state.q)


def ticks_until(ros: Ros, node: SimNode, tau: list[float]) -> None:
    def acts() -> bool:
        node.tick()
        return np.array_equal(node.simulator.effort, tau)

    ros.spin_until(acts)


def test_takes_commands_from_topics(ros: Ros, node: SimNode) -> None:
    publisher = ros.publisher(JointState, "/joint_commands")
    publisher.publish(JointState(name=list(NAMES), effort=TAU))
    ticks_until(ros, node, TAU)
    other = ros.publisher(Float64MultiArray, "/sim/commands")
    other.publish(Float64MultiArray(data=[3.0, 4.0]))
    ticks_until(ros, node, [3.0, 4.0])


def test_only_the_newest_command_counts(ros: Ros, node: SimNode) -> None:
    publisher = ros.publisher(JointState, "/joint_commands")
    for value in range(1, 51):
        publisher.publish(JointState(name=list(NAMES), effort=[float(value), 0.0]))
    acted: list[float] = []

    def last_acts() -> bool:
        node.tick()
        acted.append(node.simulator.effort[0])
        return acted[-1] == 50.0

    ros.spin_until(last_acts)
    assert acted == sorted(acted)


@pytest.fixture
def waiting(node: SimNode) -> Waiting:
    """What waits for a node that has made some ticks."""
    pending = Waiting(node)
    ticks(node, 3)
    return pending


def named(stamp: int, source: str, joint: int, effort: float) -> bytes:
    message = JointState(name=[NAMES[joint]], effort=[effort])
    message.header.frame_id = source
    message.header.stamp = to_time(stamp)
    return serialize_message(message)


def test_two_sources_lead_joints_of_their_own_in_every_tick(
    node: SimNode, waiting: Waiting
) -> None:
    acted = []
    for k in range(1, 6):
        for joint, source in enumerate(("left", "right")):
            waiting.messages.append(named(node.stamp, source, joint, float(k)))
        node.tick()
        acted.append(node.simulator.effort.tolist())
    assert acted[0][0] == 1.0
    assert acted[1:] == [[k, k] for k in range(2, 6)], "a new source is heard a tick later at most"


def test_the_answer_to_the_newest_state_acts_whatever_waits_before_it(
    node: SimNode, waiting: Waiting
) -> None:
    for stamp in (0, 1_000_000, 2_000_000, node.stamp):
        waiting.messages.append(named(stamp, "one", 0, 1e-6 * stamp))
    node.tick()
    assert node.simulator.effort[0] == 3.0


def test_commands_go_by_name(node: SimNode) -> None:
    node.on_joint_commands(command(name=list(NAMES[::-1]), effort=TAU[::-1]))
    np.testing.assert_array_equal(acting(node), TAU)


def test_joints_without_a_new_command_keep_their_last(node: SimNode) -> None:
    node.on_joint_commands(command(name=[NAMES[0]], effort=[0.5]))
    np.testing.assert_array_equal(acting(node), [0.5, 0.0])
    node.on_joint_commands(command(name=[NAMES[1]], effort=[0.7]))
    np.testing.assert_array_equal(acting(node), [0.5, 0.7])


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"name": ["nobody"], "effort": [1.0]}, "unknown joints nobody"),
        ({"name": list(NAMES), "effort": [1.0]}, "effort has 1 numbers for 2 joints"),
        ({"name": list(NAMES), "effort": [1.0, np.nan]}, "is nan; allowed are finite numbers"),
        ({"name": list(NAMES), "effort": [np.inf, 1.0]}, "is inf; allowed are finite numbers"),
        ({"name": list(NAMES), "position": [1.0, 1.0]}, "effort has 0 numbers"),
        ({}, "are missing"),
    ],
)
def test_bad_commands_are_passed_over(
    node: SimNode, fields: dict[str, Any], complaint: str, capfd: pytest.CaptureFixture[str]
) -> None:
    node.on_joint_commands(command(name=list(NAMES), effort=TAU))
    node.on_joint_commands(command(**fields))
    np.testing.assert_array_equal(acting(node), TAU)
    said = capfd.readouterr().err
    assert "command passed over" in said
    assert complaint in said


@pytest.mark.parametrize("data", [[], [1.0], [1.0] * 3, [np.nan, 0.0], [0.0] * 100_000])
def test_bad_arrays_are_passed_over(
    node: SimNode, data: list[float], capfd: pytest.CaptureFixture[str]
) -> None:
    node.on_commands(Float64MultiArray(data=TAU))
    node.on_commands(Float64MultiArray(data=data))
    np.testing.assert_array_equal(acting(node), TAU)
    said = capfd.readouterr().err
    assert "allowed are 2 finite numbers" in said
    assert len(said) < 1000


def test_effort_beyond_its_limit_is_cut_and_said(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node = by_hand(ros, "panda")
    node.on_commands(Float64MultiArray(data=[0.0, 1000.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    node.tick()
    limit = node.simulator.model.effort_limit[1]
    assert node.simulator.effort[1] == limit
    assert f"1000 of joint 'panda_joint2' is beyond its limit {limit:g}" in capfd.readouterr().err


@pytest.mark.parametrize("policy", ["zero", "hold", "gravity"])
def test_old_commands_give_way_to_the_policy(
    ros: Ros, policy: str, capfd: pytest.CaptureFixture[str]
) -> None:
    node, sim = (
        by_hand(ros, command_timeout=0.005, stale_policy=policy),
        models.simulator("two_link"),
    )
    wanted = {
        "zero": lambda: np.zeros(2),
        "hold": lambda: np.array(TAU),
        "gravity": lambda: sim.dynamics.gravity(sim.state.q),
    }[policy]
    node.on_commands(Float64MultiArray(data=TAU))
    for count in range(30):
        node.tick()
        sim.step(TAU if count < 5 else wanted())
        np.testing.assert_array_equal(motion(node), [sim.state.q, sim.state.v])
    assert capfd.readouterr().err.count(f"the policy '{policy}' acts") == 1
    node.on_commands(Float64MultiArray(data=TAU))
    node.tick()
    assert "commands are back" in capfd.readouterr().err


def test_reset_is_not_taken_for_a_command(
    ros: Ros, node: SimNode, capfd: pytest.CaptureFixture[str]
) -> None:
    node.on_commands(Float64MultiArray(data=TAU))
    for _ in range(150):
        node.tick()
    assert node.commands.stale
    node.requests.on_reset(Trigger.Request(), Trigger.Response())
    node.tick()
    assert "commands are back" not in capfd.readouterr().err
