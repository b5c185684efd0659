# SPDX-License-Identifier: Apache-2.0
"""Commands by joint name that are read before each tick: most by C, the others by Python."""

from collections.abc import Callable

from rclpy.node import Node

from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_dynamics.ros.joint_state import FAILED, JointStateReader
from arm_sim.ros.tick_engine import TickEngine

# A message and its arrival in [ns], if there is one
Take = Callable[[], tuple[bytes, int] | None]
MOST_MESSAGES = JOINT_COMMANDS.subscribe.depth  # messages read in one tick


class PolledCommands:
    """Lets C take messages, and accept those of efforts that Python need not check.

    Args:
        engine: What ticks.
        reader: Reads efforts by joint name.
        process: Processes a message that arrived at a time in [ns], or None in place of one that
            was lost; returns its stamp in [ns], or None if it is refused.
        is_guarded: Returns whether each command must be checked by ``process``.
    """

    def __init__(
        self, engine: TickEngine, reader: JointStateReader,
        process: Callable[[bytes | None, int], int | None], is_guarded: Callable[[], bool],
    ) -> None:  # fmt: skip
        self._engine, self._reader = engine, reader
        self._process, self._is_guarded = process, is_guarded
        self._subscription: PolledSubscription | None = None
        self._take_again: Take = lambda: None
        engine.ticks.answer(read=self._read)
        engine.ticks.before_ticks.append(self._refresh)

    def open(self, node: Node) -> None:
        """Subscribe, for messages to be read before each tick."""
        self._subscription = subscription = PolledSubscription(node, JOINT_COMMANDS)
        self.read_from(subscription.pointer, subscription.take)
        self._engine.ticks.most_messages = MOST_MESSAGES

    def read_from(self, subscription: int, take_again: Take) -> None:
        """Let C read the messages of an ``rcl_subscription_t``.

        ``take_again`` returns a message and its arrival in [ns] after C has failed to, or raises
        why.
        """
        self._reader.open(subscription)
        self._take_again = take_again
        self._engine.ticks.source, self._engine.ticks.reader = self._reader.addresses

    def close(self) -> None:
        """End the subscription."""
        self._engine.ticks.most_messages = 0
        self._reader.close()
        if self._subscription is not None:
            self._subscription.close()
            self._subscription = None

    def _refresh(self) -> None:
        """Let C know whose messages it may accept."""
        engine, kinds = self._engine, list[bool]()
        delayed = engine.commands.line is not None
        if (leader := engine.arbiter.leader) and not (delayed or self._is_guarded()):
            source, joints = leader
            if len(joints) == engine.simulator.n:
                kinds = self._reader.complete_kinds(source)
        engine.ticks.trust(kinds)

    def _read(self) -> bool:
        """Process the message that C has taken and leaves to Python.

        Returns whether no newer one is expected: after the answer to the newest state none is,
        unless there are other sources. A read without result takes as long as one with a message.
        """
        engine, reader = self._engine, self._reader
        failed = engine.ticks.outcome == FAILED
        message = self._take_again() if failed else (reader.raw, reader.arrival)
        stamp = self._process(*(message or (None, 0)))
        engine.ticks.stamp = -1 if stamp is None else stamp
        return bool(stamp) and stamp == engine.round_trip.newest and engine.arbiter.has_one_source
