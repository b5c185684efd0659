# SPDX-License-Identifier: Apache-2.0
"""Publishes the forces of the constraints, while somebody listens."""

from __future__ import annotations

from arm_msgs.msg import Multipliers
from rclpy.node import Node

from arm_dynamics.ros.common.convert import to_time
from arm_sim.ros import interfaces
from arm_sim.simulator import Simulator


class MultiplierOutput:
    """The topic ``~/multipliers`` of a scene with bilateral constraints; no topic without any."""

    def __init__(self, node: Node, simulator: Simulator) -> None:
        """Advertise it."""
        self._simulator = simulator
        self._publisher = None
        if simulator.model.scene.bilateral:
            topic = interfaces.MULTIPLIERS
            self._publisher = node.create_publisher(topic.type, topic.name, topic.publish)
            simulator.multipliers()  # what is found out only once is not left to the loop

    def publish(self, stamp: int) -> None:
        """Publish the present forces, stamped with the simulated time in [ns]."""
        if self._publisher is None or self._publisher.get_subscription_count() == 0:
            return
        simulator = self._simulator
        message = Multipliers(names=list(simulator.dynamics.constrained.names))
        message.values = simulator.multipliers().tolist()
        message.header.stamp = to_time(stamp)
        self._publisher.publish(message)
