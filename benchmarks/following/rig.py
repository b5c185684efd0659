# SPDX-License-Identifier: Apache-2.0
"""An arm and its controller node whose time passes only when the client lets it.

States and commands are handed over as the bytes that they are on topics; goals, feedback and
results go over ROS. So a run does not depend on the load of the machine.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.context import Context
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.ros.controller_node import ControllerNode
from arm_dynamics.ros.joint_state import JointStateReader, JointStateWriter
from arm_sim import Simulator

_TICKS = 5  # at once


class Rig:
    """A simulator with the scene's sensors and lines, answered by a controller node.

    Attributes:
        node: The controller; to be spun by the caller.
        simulator: The arm.
    """

    def __init__(self, scene: Any, context: Context) -> None:
        """Build both; the arm is held where it begins."""
        self.simulator = Simulator(scene)
        self.node = ControllerNode(scene, context=context)
        names = self.simulator.joint_names
        self._writer = JointStateWriter(names, ("position", "velocity"))
        self._reader = JointStateReader(names, ("effort",), partial=False, extra=False)
        self._state = b""
        self._tick()

    @property
    def state(self) -> JointState:
        """The newest joint state."""
        message: JointState = deserialize_message(self._state, JointState)
        return message

    def advance(self) -> None:
        """Let some milliseconds pass."""
        for _ in range(_TICKS):
            self._tick()

    def _tick(self) -> None:
        sim, measured = self.simulator, self.simulator.measured
        stamp = round(1e9 * sim.state.time)
        self._state = self._writer.write(stamp, measured.q, measured.v)
        command = self.node.on_joint_states(self._state)
        assert command is not None, "the controller gave no answer"
        _, (effort,) = self._reader.read(command)
        sim.step(np.array(effort))
