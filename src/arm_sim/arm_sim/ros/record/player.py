# SPDX-License-Identifier: Apache-2.0
"""Plays a recording on topics, with its original timing."""

import time
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
from rclpy.node import Node

from arm_dynamics.exceptions import InvalidInput, choices, known_names
from arm_dynamics.ros.interfaces import EVERY, LATCHED, ROBOT_DESCRIPTION
from arm_sim.exceptions import NoRecording
from arm_sim.recording.files.messages import CHANGE, JOINT_STATE, TICK, joint_state_layout
from arm_sim.recording.files.reader import BAGS, read_bag
from arm_sim.recording.recording import Recording
from arm_sim.ros.record.definitions import type_of

_OURS = (TICK, CHANGE)  # topics that exist only in files
_STATES = "/joint_states"


# Times in [ns] and messages, serialized, by topic and type
Content = dict[tuple[str, str], list[tuple[int, bytes]]]


def _messages(path: Path, topics: tuple[str, ...]) -> Content:
    """The messages of a bag on some topics, on all if none is named."""
    bag = read_bag(path, lambda topic, kind: topic in topics if topics else kind not in _OURS)
    if unknown := [topic for topic in topics if topic not in bag.topics]:
        raise InvalidInput(
            f"'{path}' has no topic {known_names(unknown)}; {choices(unknown[0], [*bag.topics])}"
        )
    return {
        (topic, bag.topics[topic]): [(log, raw) for _, log, raw in messages]
        for topic, messages in bag.messages.items()
        if messages
    }


def _joint_states(path: Path) -> Content:
    """The joint states of a recording that has no messages."""
    recording = Recording.load(path)
    stamps = np.round(1e9 * recording.time).astype(np.int64)
    # A state reports the effort of the tick that ended at it; the first that of the next one.
    messages = joint_state_layout(recording.joint_names).written(
        stamps, position=recording.q, velocity=recording.v,
        effort=np.vstack([recording.tau[:1], recording.tau[:-1]]),
    )  # fmt: skip
    return {(_STATES, JOINT_STATE): list(zip(stamps.tolist(), messages, strict=True))}


class Player(Node):
    """Publishes the messages of a recording.

    Attributes:
        obstacles: Why topics are not played, by topic.
        count: Number of messages so far.
    """

    def __init__(self, path: Path, topics: tuple[str, ...] = (), **node_kwargs: Any) -> None:
        """Read a bag, or a recording without messages, played as joint states; advertise topics.

        All topics are played that can be, if none is named.

        Raises:
            InvalidInput: If there is nothing to play.
            OSError: If it cannot be read.
        """
        super().__init__("player", **node_kwargs)
        self.obstacles, self.count = dict[str, str](), 0
        self._stop = Event()
        self._thread: Thread | None = None
        if not path.exists():
            raise NoRecording(f"no recording '{path}'")
        is_bag = path.suffix in BAGS or path.is_dir()
        unknown = [] if is_bag else [topic for topic in topics if topic != _STATES]
        if unknown:
            raise InvalidInput(f"'{path}' has no topic {known_names(unknown)}; it has '{_STATES}'")
        content = _messages(path, topics) if is_bag else _joint_states(path)
        self._pending: list[tuple[int, Any, bytes]] = []
        for (topic, kind), messages in content.items():
            if (type_ := type_of(kind)) is None:
                self.obstacles[topic] = f"type {kind} is not installed"
                continue
            latched = topic.rpartition("/")[2] == ROBOT_DESCRIPTION.name
            publisher = self.create_publisher(type_, topic, LATCHED if latched else EVERY)
            self._pending += [(log, publisher, raw) for log, raw in messages]
        if not self._pending:
            obstacles = ", ".join(f"{topic}: {why}" for topic, why in self.obstacles.items())
            raise InvalidInput(f"'{path}' contains nothing to play; {obstacles or 'it is empty'}")
        self._pending.sort(key=lambda item: item[0])

    @property
    def duration(self) -> float:
        """Duration in [s] at rate 1."""
        return 1e-9 * (self._pending[-1][0] - self._pending[0][0])

    def start(self, rate: float = 1.0) -> None:
        """Publish all messages in a thread, at a rate relative to the clock; 0: at once.

        Raises:
            InvalidInput: If the rate is negative or not finite.
        """
        if not 0.0 <= rate < float("inf"):
            raise InvalidInput(f"rate = {rate}; allowed: finite numbers of at least 0")
        self._thread = Thread(target=self._play, args=(rate,), name="player", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether everything has been published."""
        return self._thread is not None and not self._thread.is_alive()

    def destroy_node(self) -> None:
        """Stop, and destroy the node."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
        super().destroy_node()

    def _play(self, rate: float) -> None:
        begun, first = time.monotonic(), self._pending[0][0]
        for log, publisher, raw in self._pending:
            due = begun + 1e-9 * (log - first) / rate if rate else begun
            if self._stop.wait(max(0.0, due - time.monotonic())):
                return
            publisher.publish(raw)
            self.count += 1
