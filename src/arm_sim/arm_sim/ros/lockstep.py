# SPDX-License-Identifier: Apache-2.0
"""Sim and controller advance together: a tick is made when its state has been answered."""

from __future__ import annotations

import os
import time

from rclpy.node import Node

from arm_dynamics.ros.common.executor import steady_timer, subscribe
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim.ros.inputs import Inputs
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.params import SimParams
from arm_sim.ros.tick_engine import TickEngine

_SOON = 300_000  # [ns] within which an answer is worth busy-waiting for
_STRETCH = 20_000_000  # [ns] after which other callbacks get their turn


class Lockstep:
    """Waits for the command that bears the stamp of the present state, and asks for it again.

    A state is answered by the command with its stamp, once; a command with another stamp is late
    and makes no tick. A state that stays unanswered is published again, and a partner that does
    not answer for ``lockstep_timeout`` is reported gone; time stands still until one answers. All
    of it happens in the thread that spins the node.

    Attributes:
        asked_again: How often a state had to be published again.
        ignored: Commands that answered no state that was waiting.
        gone: Whether the partner is reported gone.
    """

    def __init__(
        self, node: Node, params: SimParams, engine: TickEngine, inputs: Inputs, outputs: Outputs
    ) -> None:
        """Listen to commands, and check on the partner by a timer."""
        self._engine, self._inputs, self._outputs = engine, inputs, outputs
        self._log, self._every = node.get_logger(), params.publish_every
        self._retry = round(1e9 * params.lockstep_retry)
        self._timeout = round(1e9 * params.lockstep_timeout)
        self._glance = 0.5 * params.lockstep_retry
        self.asked_again = self.ignored = 0
        self.gone = False
        self._waiting: int | None = None
        self._asked = self._first = time.monotonic_ns()
        self._subscription = subscribe(node, JOINT_COMMANDS, self.on_command, raw=True)
        steady_timer(node, self._glance, self.look)
        engine.on_jump.append(self.wait)
        engine.on_pause += [outputs.publish, self.wait]

    def on_command(self, raw: bytes) -> None:
        """Take a command, and those that come soon after it, for ``_STRETCH`` at most.

        To go to sleep and be woken again takes longer than most answers.
        """
        end = time.monotonic_ns() + _STRETCH
        self._take(raw)
        while time.monotonic_ns() < end and (soon := self._soon()) is not None:
            self._take(soon)

    def _take(self, raw: bytes) -> None:
        """Tick to the next published state if the command answers the present one."""
        stamp = self._inputs.on_joint_commands(raw, time.time_ns())
        if stamp is None:
            return
        if stamp != self._waiting:
            self.ignored += 1
            return
        if self.gone:
            self.gone = False
            self._log.info("the partner is back")
        engine = self._engine
        engine.tick_unattended()
        while not engine.paused and engine.simulator.step_count % self._every:
            engine.tick_unattended()
        self.wait()

    def _soon(self) -> bytes | None:
        """A command that comes within ``_SOON``; meanwhile others may have the processor."""
        while self._waiting is not None and time.monotonic_ns() - self._asked < _SOON:
            taken = self._subscription.handle.take_message(self._subscription.msg_type, True)
            if taken is not None:
                return bytes(taken[0])
            os.sched_yield()
        return None

    def wait(self) -> None:
        """Wait for the answer to the state published last, or for nothing while paused."""
        self._waiting = None if self._engine.paused else self._engine.stamp
        self._asked = self._first = time.monotonic_ns()

    def look(self) -> None:
        """Ask again, or report the partner gone, when it is time to."""
        if self._engine.paused:
            self._outputs.repeat(self._glance)
            return
        now = time.monotonic_ns()
        if not self.gone and now - self._first > self._timeout:
            self.gone = True
            self._log.error(
                f"no answer to the state of {1e-9 * self._engine.stamp:.6f} s for "
                f"{1e-9 * self._timeout:g} s: the partner is gone; time stands still"
            )
        if now - self._asked > self._retry:
            self.asked_again += 1
            self._asked = now
            self._outputs.publish()
