# SPDX-License-Identifier: Apache-2.0
"""Sim and controller advance together: a tick is made when its state has been answered."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

from arm_dynamics.ros.common.executor import surviving
from arm_sim.ros import interfaces

if TYPE_CHECKING:
    from arm_sim.ros.sim_node import SimNode

_SOON = 300_000  # [ns] within which an answer is worth waiting for awake
_STRETCH = 20_000_000  # [ns] after which others get their turn


class Lockstep:
    """Waits for the command that bears the stamp of the present state, and asks for it again.

    A state is answered by the command with its stamp, once; a command with another stamp is a late
    one and makes no tick. A state that stays without answer is published again, and a partner that
    gives none for ``lockstep_timeout`` is reported gone; time stands still until one answers. All
    of it happens in the thread that spins the node.

    Attributes:
        asked_again: How often a state had to be published again.
        ignored: Commands that answered no state that was waiting.
        gone: Whether the partner is reported gone.
    """

    def __init__(self, node: SimNode) -> None:
        """Listen to commands and look after the partner of ``node``."""
        self._node, params = node, node.params
        self._retry = round(1e9 * params.lockstep_retry)
        self._timeout = round(1e9 * params.lockstep_timeout)
        self._glance = 0.5 * params.lockstep_retry
        self.asked_again = self.ignored = 0
        self.gone = False
        self._waiting: int | None = None
        self._asked = self._first = time.monotonic_ns()
        topic = interfaces.JOINT_COMMANDS
        answer = surviving(node, self.on_command)
        self._subscription = node.create_subscription(
            topic.type, topic.name, answer, topic.subscribe, raw=True
        )
        node.create_timer(self._glance, self.look)

    def on_command(self, raw: bytes) -> None:
        """Take a command, and those that come soon after it, for ``_STRETCH`` at most.

        To go to sleep and be woken again takes longer than most answers.
        """
        end = time.monotonic_ns() + _STRETCH
        self._take(raw)
        while time.monotonic_ns() < end and (soon := self._soon()) is not None:
            self._take(soon)

    def _take(self, raw: bytes) -> None:
        """Make the tick if the command answers the present state."""
        stamp = self._node.on_joint_commands(raw, time.time_ns())
        if stamp is None:
            return
        if stamp != self._waiting:
            self.ignored += 1
            return
        if self.gone:
            self.gone = False
            self._node.get_logger().info("a partner answers again")
        self._node.tick_to_next_state()
        self.wait()

    def _soon(self) -> bytes | None:
        """A command that comes within ``_SOON``; the processor is left to whoever wants it."""
        while self._waiting is not None and time.monotonic_ns() - self._asked < _SOON:
            taken = self._subscription.handle.take_message(self._subscription.msg_type, True)
            if taken is not None:
                return bytes(taken[0])
            os.sched_yield()
        return None

    def wait(self) -> None:
        """Wait for the answer to the state published last, or for nothing while paused."""
        self._waiting = None if self._node.paused else self._node.stamp
        self._asked = self._first = time.monotonic_ns()

    def look(self) -> None:
        """Ask again, or report the partner gone, when it is time to."""
        if self._node.paused:
            self._node.repeat(self._glance)
            return
        now = time.monotonic_ns()
        if not self.gone and now - self._first > self._timeout:
            self.gone = True
            self._node.get_logger().error(
                f"no answer to the state of {1e-9 * self._node.stamp:.6f} s for "
                f"{1e-9 * self._timeout:g} s: the partner is gone; time stands still"
            )
        if now - self._asked > self._retry:
            self.asked_again += 1
            self._asked = now
            self._node.publish_state()
