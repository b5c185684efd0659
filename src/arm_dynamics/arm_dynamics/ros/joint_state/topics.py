# SPDX-License-Identifier: Apache-2.0
"""JointStates of a topic, in and out as bytes, for loops at 1 kHz."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy.node import Node

from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.direct import Newest
from arm_dynamics.ros.interfaces import Topic
from arm_dynamics.ros.joint_state.serialization import JointStateReader, JointStateWriter, Read


class JointStateSource:
    """JointStates of a topic for a loop that polls; no executor is needed."""

    def __init__(self, node: Node, topic: Topic, reader: JointStateReader) -> None:
        """Subscribe; ``close`` before the node is destroyed."""
        self.newest, self._reader = Newest(node, topic), reader

    def take(self) -> tuple[int, Read] | None:
        """Take the next message; None if there is none.

        Returns:
            The system time it came at in [ns], and what ``JointStateReader.read`` returns.

        Raises:
            InvalidInput: As ``JointStateReader.read``.
        """
        taken = self.newest.take()
        return None if taken is None else (taken[1], self._reader.read(taken[0]))

    def close(self) -> None:
        """End the subscription."""
        self.newest.close()


class JointStateSink:
    """Publishes JointStates whose numbers stand in arrays that stay."""

    def __init__(
        self, node: Node, topic: Topic, writer: JointStateWriter, arrays: Sequence[Array]
    ) -> None:
        """Advertise the topic.

        No other thread may be using it when the node is destroyed.

        Args:
            node: The publishing node.
            topic: Where.
            writer: Of the messages.
            arrays: One for each of the writer's fields, contiguous, shape (n,).
        """
        publisher = node.create_publisher(topic.type, topic.name, topic.publish)
        self.handle, self.writer, self.arrays = publisher.handle, writer, tuple(arrays)

    def send(self, stamp: int) -> None:
        """Publish what the arrays hold now, with this time in [ns]."""
        self.handle.publish_raw(self.writer.write(stamp, *self.arrays))
