# SPDX-License-Identifier: Apache-2.0
"""Records the topics of a running system, as ``ros2 bag record`` does."""

import time
from array import array
from collections import defaultdict
from functools import partial
from pathlib import Path
from struct import unpack_from
from typing import Any

import numpy as np
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.validate_topic_name import validate_topic_name

from arm_dynamics.cdr import GIGA, HEADER
from arm_dynamics.exceptions import InvalidInput
from arm_sim.recording.files import McapWriter, new_file
from arm_sim.recording.files.messages import JOINT_STATE, LATCHED
from arm_sim.ros.record.chunk_thread import ChunkThread
from arm_sim.ros.record.definitions import definition_of, type_of

_PERIOD = 0.5  # [s] between checks for new topics
_DEPTH = 1000  # length of the message queue


class TopicRecorder(Node):
    """Subscribes to topics and writes their messages in order of arrival.

    Attributes:
        count: Number of messages so far, by topic.
        obstacles: Why topics are not recorded, by topic.
        path: The file or folder.
        thread: The writing thread.
    """

    _complete = False  # a node that could not be built is destroyed, too, by Kilted's rclpy

    def __init__(self, path: Path, topics: tuple[str, ...] = (), **node_kwargs: Any) -> None:
        """Create the file, ``.mcap`` or a bag's folder, for all topics if none is named.

        Raises:
            InvalidInput: If the path has another suffix, or exists already, or a name is not that
                of a topic.
            OSError: If it cannot be written.
        """
        super().__init__("recorder", **node_kwargs)
        self._requested = {self._resolved(topic) for topic in topics}
        self.path = path
        self.thread = ChunkThread(McapWriter(new_file(path)), self.get_logger().error)
        self.count, self.obstacles = dict[str, int](), dict[str, str]()
        self._stamps = defaultdict[str, array[int]](lambda: array("q"))
        self._complete = True
        self.discover()
        self.create_timer(_PERIOD, self.discover)

    def _resolved(self, topic: str) -> str:
        try:
            validate_topic_name(topic)
        except InvalidTopicNameException:
            raise InvalidInput(
                f"'{topic}' is not the name of a topic; allowed: letters, digits, _ and /, as in "
                "/joint_states"
            ) from None
        return str(self.resolve_topic_name(topic))

    def discover(self) -> None:
        """Subscribe to topics that are new."""
        for topic, kinds in self.get_topic_names_and_types():
            is_hidden = "/_" in topic  # as those of actions, which are recorded by name only
            is_wanted = topic in self._requested if self._requested else not is_hidden
            if not is_wanted or topic in self.count or topic in self.obstacles:
                continue
            if not (publishers := self.get_publishers_info_by_topic(topic)):
                continue
            try:
                self._subscribe(topic, kinds[0], [info.qos_profile for info in publishers])
            except InvalidInput as error:
                self.obstacles[topic] = str(error)
                self.get_logger().warning(f"'{topic}' is not recorded: {error}")

    @property
    def missing(self) -> tuple[str, ...]:
        """Requested topics that do not exist yet."""
        return tuple(sorted(self._requested - set(self.count) - set(self.obstacles)))

    @property
    def gaps(self) -> dict[str, int]:
        """About how many joint states are missing between others, by their stamps."""
        steps = {topic: np.diff(times) for topic, times in self._stamps.items() if len(times) > 1}
        more = {topic: np.rint(x / max(np.median(x), 1.0)) - 1.0 for topic, x in steps.items()}
        return {topic: int(x.clip(0.0).sum()) for topic, x in more.items() if x.max() > 0.0}

    def _subscribe(self, topic: str, kind: str, offered: list[QoSProfile]) -> None:
        """Subscribe to a topic, compatibly with the qualities of service that are offered."""
        if (type_ := type_of(kind)) is None:
            raise InvalidInput(f"type {kind} is not installed")
        # The weakest quality of service, which is compatible with every publisher.
        profile = QoSProfile(depth=_DEPTH)  # reliable and volatile
        if any(qos.reliability != ReliabilityPolicy.RELIABLE for qos in offered):
            profile.reliability = ReliabilityPolicy.BEST_EFFORT
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        if latched:
            profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
        channel = self.thread.channel(topic, kind, definition_of(kind), LATCHED if latched else "")
        self.count[topic] = 0
        take = partial(self._take, topic, channel, kind == JOINT_STATE)
        self.create_subscription(type_, topic, take, profile, raw=True)

    def _take(self, topic: str, channel: int, stamped: bool, raw: bytes) -> None:
        now = time.time_ns()
        self.count[topic] += self.thread.add(channel, now, now, raw)
        if stamped:
            seconds, nanoseconds = unpack_from("<iI", raw, HEADER)
            self._stamps[topic].append(GIGA * seconds + nanoseconds)

    def destroy_node(self) -> None:
        """Write the remaining messages, and destroy the node."""
        if self._complete:
            self.thread.close()
        super().destroy_node()
