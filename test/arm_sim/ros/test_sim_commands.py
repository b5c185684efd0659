# SPDX-License-Identifier: Apache-2.0
"""Commands to the sim node, ticked by hand."""

import time
from typing import Any

import numpy as np
import pytest
from harness import Ros
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import NAMES, TAU, by_hand, command, motion, next_command, ticks
from std_msgs.msg import Float64MultiArray

import models
from arm_dynamics.ros.common.convert import to_time
from arm_dynamics.ros.interfaces import RESET
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros


@pytest.fixture
def node(ros: Ros) -> SimNode:
    """A two-link arm whose ticks are triggered by hand."""
    return by_hand(ros)


def acting(node: SimNode) -> np.ndarray:
    """The torque of the next tick."""
    return next_command(node.engine.commands, node.simulator.state.q)


def named(stamp: int, source: str, joint: int, effort: float) -> bytes:
    message = JointState(name=[NAMES[joint]], effort=[effort])
    message.header.frame_id = source
    message.header.stamp = to_time(stamp)
    return serialize_message(message)


def test_all_commands_that_come_within_a_tick_are_looked_at(ros: Ros, node: SimNode) -> None:
    """Sixteen sources: one in control, and fifteen others."""
    for _ in range(10):
        node.inputs.on_joint_commands(named(0, "leader", 0, 1.0))
    publisher = ros.publisher(JointState, "/joint_commands")
    heard = ros.listen(JointState, "/joint_commands", 50)
    publisher.publish(named(0, "leader", 0, 2.0))
    for _ in range(15):
        publisher.publish(named(0, "other", 0, 9.0))
    ros.spin_until(lambda: len(heard) == 16)  # so the node, too, has all of them
    node.tick()
    assert node.simulator.effort[0] == 2.0
    assert node.engine.arbiter.refused == 15


def test_of_bare_commands_only_the_newest_is_taken(ros: Ros, node: SimNode) -> None:
    publisher = ros.publisher(Float64MultiArray, "/sim/commands")
    beside = ros.peer.create_subscription(Float64MultiArray, "/sim/commands", print, 10)
    ros.spin_until(lambda: publisher.get_subscription_count() == 2)
    for count in range(1, 6):
        publisher.publish(Float64MultiArray(data=[0.0] * (10 + count)))
    left = 5
    while left:  # until all of them are there, without a look into the node's own subscription
        with beside.handle:
            left -= beside.handle.take_message(Float64MultiArray, False) is not None
    time.sleep(0.05)
    ros.spin_until(lambda: node.inputs.refused)
    end = time.monotonic() + 0.2
    ros.spin_until(lambda: time.monotonic() > end)
    assert node.inputs.refused == 1


def test_quality_of_service(ros: Ros) -> None:
    """Best effort where the newest counts, so that every publisher will do."""
    node = by_hand(ros, publish_clock=True)
    effort, every = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
    for topic, reliability in (
        ("/joint_commands", effort), ("/sim/commands", effort), ("/sim/wrench", every),
        ("/joint_states", every), ("/sim/energy", every), ("/clock", every),
    ):  # fmt: skip
        (end,) = (
            *node.get_subscriptions_info_by_topic(topic), *node.get_publishers_info_by_topic(topic)
        )  # fmt: skip
        assert end.qos_profile.reliability == reliability
        assert end.qos_profile.durability == DurabilityPolicy.VOLATILE


def test_joints_without_a_new_command_keep_their_last(node: SimNode) -> None:
    node.inputs.on_joint_commands(command(name=[NAMES[0]], effort=[0.5]))
    np.testing.assert_array_equal(acting(node), [0.5, 0.0])
    node.inputs.on_joint_commands(command(name=[NAMES[1]], effort=[0.7]))
    np.testing.assert_array_equal(acting(node), [0.5, 0.7])


def test_bad_commands_are_passed_over(node: SimNode, capfd: pytest.CaptureFixture[str]) -> None:
    node.inputs.on_joint_commands(command(name=list(NAMES), effort=TAU))
    bad: tuple[dict[str, Any], ...] = (
        {"name": ["nobody"], "effort": [1.0]}, {"name": list(NAMES), "effort": [1.0]},
        {"name": list(NAMES), "effort": [1.0, np.nan]},
        {"name": list(NAMES), "effort": [np.inf, 1.0]},
        {"name": list(NAMES), "position": [1.0]}, {"name": list(NAMES), "velocity": [np.inf, 1.0]},
        {"name": list(NAMES)}, {},
    )  # fmt: skip
    for count, fields in enumerate(bad, 1):
        node.inputs.on_joint_commands(command(**fields))
        np.testing.assert_array_equal(acting(node), TAU)
        assert node.inputs.refused == count
    said = capfd.readouterr().err
    assert "command ignored: unknown joints nobody" in said and "effort has 1 numbers" in said


def test_mimic_joints_may_be_commanded_as_they_follow(
    ros: Ros, capfd: pytest.CaptureFixture[str]
) -> None:
    node, both = by_hand(ros, "gripper"), ["left_slide", "right_slide"]
    node.inputs.on_joint_commands(command(name=both, position=[0.03, -0.011]))
    np.testing.assert_array_equal(acting(node).position, [np.nan, 0.03])
    for fields in ({"name": both, "position": [0.02, 0.02]}, {"name": both[1:], "effort": [1.0]}):
        node.inputs.on_joint_commands(command(**fields))
        np.testing.assert_array_equal(acting(node).position, [np.nan, 0.03])
    assert node.inputs.refused == 2
    assert "command ignored: position: right_slide is 0.02, but right_" in capfd.readouterr().err


def test_bad_arrays_are_passed_over(node: SimNode) -> None:
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    for count, data in enumerate(([], [1.0], [1.0] * 3, [np.nan, 0.0], [0.0] * 1000), 1):
        node.inputs.on_commands(Float64MultiArray(data=data))
        np.testing.assert_array_equal(acting(node), TAU)
        assert node.inputs.refused == count


@pytest.mark.parametrize(
    ("topic", "effort"), [("joint_commands", 1000.0), ("~/commands", -1000.0)]
)
def test_effort_beyond_its_limit_is_clipped_and_reported_once(
    ros: Ros, topic: str, effort: float,
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    node = by_hand(ros, "panda")
    efforts = [1.0, effort, 0.0, 0.0, 0.0, 0.0, -2.0]
    for _ in range(4):
        if topic == "joint_commands":
            node.inputs.on_joint_commands(command(name=node.simulator.joint_names, effort=efforts))
        else:
            node.inputs.on_commands(Float64MultiArray(data=efforts))
        node.tick()
    limit = node.simulator.model.effort_limit[1]
    expected = [1.0, np.copysign(limit, effort), 0.0, 0.0, 0.0, 0.0, -2.0]
    np.testing.assert_array_equal(node.simulator.effort, expected)
    told = f"command {effort:g} N m of joint 'panda_joint2' exceeds its limit of {limit:g} N m"
    assert capfd.readouterr().err.count(told) == 1
    assert not caplog.records  # the simulation itself has nothing to add


@pytest.mark.parametrize("policy", ["zero", "hold", "gravity"])
def test_old_commands_give_way_to_the_policy(
    ros: Ros, policy: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """As before the first command, but that ``hold`` then has something to hold."""
    node = by_hand(ros, command_timeout=0.005, stale_policy=policy)
    sim = models.simulator("two_link")
    for count in range(-5, 30):
        if count == 0:
            node.inputs.on_commands(Float64MultiArray(data=TAU))
        wanted = np.zeros(2)
        if policy == "gravity":
            wanted = sim.dynamics.gravity(sim.state.q)
        if 0 <= count < 5 or (policy == "hold" and count >= 5):
            wanted = np.array(TAU)
        node.tick()
        sim.step(wanted)
        np.testing.assert_array_equal(motion(node), [sim.state.q, sim.state.v])
    assert capfd.readouterr().err.count(f"(stale_policy: {policy})") == 1
    node.inputs.on_commands(Float64MultiArray(data=TAU))
    node.tick()
    assert "commands have resumed" in capfd.readouterr().err
    ticks(node, 10)
    assert node.engine.commands.stale
    node.requests.answer(RESET)
    node.tick()
    assert "commands have resumed" not in capfd.readouterr().err, "a reset is no command"
