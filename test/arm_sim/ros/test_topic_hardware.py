# SPDX-License-Identifier: Apache-2.0
"""The sim as the robot behind the JointState-topic hardware of ros2_control."""

import numpy as np
import pytest
from harness import Ros
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from sim_by_hand import by_hand, ticks

from arm_dynamics.ros.common.convert import to_time

pytestmark = pytest.mark.ros


class TopicHardware:
    """The hardware without its controller manager, on a Panda, with commands of one kind.

    It behaves as its source does, ros-controls/topic_based_hardware_interfaces,
    joint_state_topic_hardware_interface.cpp: a cycle publishes the commands of all joints, unless
    Σ|state - command| is within a threshold.
    """

    def __init__(self, ros: Ros, field: str, threshold: float = 1e-5, **parameters: float) -> None:
        self.node = by_hand(ros, "panda", stale_policy="brake", **parameters)
        self.simulator = self.node.simulator
        self._field, self._threshold = field, threshold
        self.command, self.published = self.simulator.state.q, 0

    def cycle(self) -> None:
        """One update of the controller manager, and a tick."""
        sim = self.simulator
        state = sim.state.q if self._field == "position" else sim.effort
        if abs(state - self.command).sum() > self._threshold:
            message = JointState(name=list(sim.joint_names))
            message.header.stamp = to_time(1 + self.node.engine.stamp)
            setattr(message, self._field, self.command.tolist())
            self.node.inputs.on_joint_commands(serialize_message(message))
            self.published += 1
        self.node.tick()


def test_a_static_hold_moves_no_bit(ros: Ros) -> None:
    """Before the first command by brakes, after a motion by servos; the hardware is silent."""
    hardware = TopicHardware(ros, "position", publish_every=1000)
    simulator, start = hardware.simulator, hardware.command.copy()
    for _ in range(100):
        hardware.cycle()
    assert hardware.published == 0
    np.testing.assert_array_equal(simulator.state.q, start)
    for s in np.linspace(0.0, 1.0, 1000):
        hardware.command = start + 0.2 * (10 * s**3 - 15 * s**4 + 6 * s**5)
        hardware.cycle()
    for _ in range(1000):
        hardware.cycle()
    sent, still = hardware.published, simulator.state.q.copy()
    ticks(hardware.node, 5_000)
    np.testing.assert_array_equal(simulator.state.q, still)
    hardware.cycle()
    assert hardware.published == sent
    np.testing.assert_allclose(still, start + 0.2, atol=1e-5 / 7)


@pytest.mark.parametrize(("threshold", "silent"), [(1e-5, True), (-1.0, False)])
def test_torques_want_a_threshold_of_minus_one(ros: Ros, threshold: float, silent: bool) -> None:
    """A torque that acts is what is measured: with the default the next one is not sent."""
    hardware = TopicHardware(ros, "effort", threshold, command_timeout=0.05)
    hardware.command = hardware.simulator.dynamics.gravity(hardware.command)
    for _ in range(100):
        hardware.cycle()
    assert (hardware.node.engine.commands.stale_count > 0) == silent
    assert (hardware.published == 100) != silent
