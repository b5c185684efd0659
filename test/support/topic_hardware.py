# SPDX-License-Identifier: Apache-2.0
"""A stand-in for the JointState-topic hardware of ros2_control, which behaves as its source does.

Source: ros-controls/topic_based_hardware_interfaces, joint_state_topic_hardware_interface.cpp:
states are taken by joint and interface as far as they are there and finite; a cycle publishes one
message with the commands of all joints, NaN where a joint has no such interface or nobody has
written a command, unless Σ|state - command| over all command interfaces is within a threshold.
"""

import math
from collections.abc import Mapping, Sequence

from sensor_msgs.msg import JointState

from arm_dynamics.ros.common.convert import to_time

NAN = math.nan
FIELDS = ("position", "velocity", "effort")


class TopicHardware:
    """The hardware component without its controller manager."""

    def __init__(self, interfaces: Mapping[str, Sequence[str]], threshold: float = 1e-5) -> None:
        self._threshold, self._joints = threshold, list(interfaces)
        self.state = {(joint, field): NAN for joint in interfaces for field in FIELDS}
        self.command = {(joint, f): NAN for joint, offered in interfaces.items() for f in offered}
        self.published = 0

    def activate(self) -> None:
        """A controller becomes active and holds what is."""
        for key in self.command:
            self.command[key] = self.state[key]

    def read(self, message: JointState) -> None:
        """Take a joint state."""
        for i, joint in enumerate(message.name):
            for field in FIELDS:
                values = getattr(message, field)
                if joint in self._joints and i < len(values) and math.isfinite(values[i]):
                    self.state[joint, field] = values[i]

    def write(self, now: int) -> JointState | None:
        """The message of a cycle at a time in [ns]; None while it is silent."""
        difference = sum(abs(self.state[key] - command) for key, command in self.command.items())
        if difference <= self._threshold:  # NaN is not
            return None
        message = JointState(name=self._joints)
        message.header.stamp = to_time(now)
        for field in FIELDS:
            if any(offered == field for _, offered in self.command):
                row = [self.command.get((joint, field), NAN) for joint in self._joints]
                setattr(message, field, row)
        self.published += 1
        return message
