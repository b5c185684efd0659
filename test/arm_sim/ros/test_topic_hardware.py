# SPDX-License-Identifier: Apache-2.0
"""The sim as the robot behind the JointState-topic hardware of ros2_control."""

import math

import numpy as np
import pytest
from harness import Ros
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import by_hand, state_bytes, ticks
from topic_hardware import TopicHardware

import models
from arm_sim.ros import SimNode

pytestmark = pytest.mark.ros


def cycle(node: SimNode, hardware: TopicHardware) -> None:
    """One update of the controller manager, and a tick."""
    state = deserialize_message(state_bytes(node), JointState)
    state.effort = node.simulator.effort.tolist()
    hardware.read(state)
    message = hardware.write(1 + node.engine.stamp)
    if message is not None:
        node.inputs.on_joint_commands(serialize_message(message))
    node.tick()


def offered(node: SimNode, *interfaces: str) -> dict[str, tuple[str, ...]]:
    return dict.fromkeys(node.simulator.joint_names, interfaces)


def robot(ros: Ros, **parameters: object) -> SimNode:
    return by_hand(ros, "panda", stale_policy="brake", **parameters)


def lead(node: SimNode, hardware: TopicHardware, way: np.ndarray) -> np.ndarray:
    """Positions as a trajectory controller samples them, shape (k, n); errors of the joints."""
    errors = []
    for wanted in way:
        for joint, position in zip(node.simulator.joint_names, wanted.tolist(), strict=True):
            hardware.command[joint, "position"] = position
        cycle(node, hardware)
        errors.append(node.simulator.state.q - wanted)
    return np.array(errors)


def test_a_static_hold_moves_no_bit(ros: Ros) -> None:
    """Before the first command by brakes, after a motion by servos; the hardware is silent."""
    node = robot(ros, publish_every=1000)
    hardware, start = TopicHardware(offered(node, "position")), node.simulator.state.q.copy()
    hardware.read(deserialize_message(state_bytes(node), JointState))
    hardware.activate()
    for _ in range(100):
        cycle(node, hardware)
    assert hardware.published == 0
    np.testing.assert_array_equal(node.simulator.state.q, start)
    s = np.linspace(0.0, 1.0, 1000)[:, None]
    lead(node, hardware, start + 0.2 * (10 * s**3 - 15 * s**4 + 6 * s**5))
    for _ in range(1000):
        cycle(node, hardware)
    sent, still = hardware.published, node.simulator.state.q.copy()
    ticks(node, 20_000)
    np.testing.assert_array_equal(node.simulator.state.q, still)
    cycle(node, hardware)
    assert hardware.published == sent
    np.testing.assert_allclose(still, start + 0.2, atol=1e-5 / 7)


@pytest.mark.parametrize(("threshold", "silent"), [(1e-5, True), (-1.0, False)])
def test_torques_want_a_threshold_of_minus_one(ros: Ros, threshold: float, silent: bool) -> None:
    """A torque that acts is what is measured: with the default the next one is not sent."""
    node = robot(ros, command_timeout=0.05)
    hardware = TopicHardware(offered(node, "effort"), threshold)
    weight = node.simulator.dynamics.gravity(node.simulator.state.q)
    for joint, tau in zip(node.simulator.joint_names, weight.tolist(), strict=True):
        hardware.command[joint, "effort"] = tau
    for _ in range(100):
        cycle(node, hardware)
    assert (node.engine.commands.stale_count > 0) == silent
    assert (hardware.published == 100) != silent


def test_over_topics_with_the_qualities_of_service_of_the_hardware(ros: Ros) -> None:
    node = ros.add(SimNode, models.scene("two_link"), command_timeout=0.1)
    hardware = TopicHardware(offered(node, "position"))
    start = node.simulator.state.q.copy()
    publisher = ros.peer.create_publisher(JointState, "/joint_commands", QoSProfile(depth=1))
    ros.peer.create_subscription(
        JointState, "/joint_states", hardware.read, qos_profile_sensor_data
    )
    joints = list(node.simulator.joint_names)
    ros.spin_until(lambda: math.isfinite(hardware.state[joints[1], "velocity"]))
    ros.spin_until(publisher.get_subscription_count)
    hardware.activate()
    hardware.command[joints[0], "position"] = start[0] + 0.05

    def arrived() -> bool:
        if (message := hardware.write(ros.peer.get_clock().now().nanoseconds)) is not None:
            publisher.publish(message)
        return abs(hardware.state[joints[0], "position"] - start[0] - 0.05) < 1e-6

    ros.spin_until(arrived)
    assert hardware.write(1) is None
    place = node.simulator.state.q.copy()
    assert abs(place - start - [0.05, 0.0]).max() < 1e-5
