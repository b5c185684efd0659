# SPDX-License-Identifier: Apache-2.0
"""Lockstep of simulator and controller: a tick is executed when its state has been answered."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from ctypes import Structure, byref
from enum import IntEnum

from rclpy.node import Node

from arm_dynamics.ros.common.executor import steady_timer, subscribe
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim.ros.inputs import Inputs
from arm_sim.ros.node_library import LOOP, TICKS, library
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.sim_params import SimParams
from arm_sim.ros.tick_engine import TickEngine

_SOON = 300_000  # [ns] within which busy-waiting for an answer pays
_STRETCH = 20_000_000  # [ns] after which other callbacks get their turn


class Ahead(IntEnum):
    """Outcome of processing answers in compiled code, see ticks.h.

    It cannot continue; a tick was executed, and its state must be published; no answer arrived
    soon, or others have their turn; an answer arrived, and its tick is due.
    """

    CANNOT, TOLD, NOTHING_CAME, ANSWERED = (
        TICKS.constants[name] for name in ("LEFT", "MADE", "DONE", "ANSWERED")
    )


class Waiting(Structure):
    """The state whose answer is awaited: ``waiting_t`` of loop.h, which explains the fields."""

    _fields_ = LOOP.fields("waiting_t")


class Lockstep:
    """Waits for the command with the stamp of the current state, and repeats the state if needed.

    A state is answered once, by the command with its stamp; a command with another stamp is late
    and causes no tick. An unanswered state is published again, and a partner that does not answer
    for ``lockstep_timeout`` is reported gone; time stands still until one answers. Everything
    happens in the thread that spins the node.

    Attributes:
        ahead: Processes answers in compiled code, and returns the outcome.
        asked_again: Number of states that were published again.
        gone: Whether the partner is reported gone.
    """

    def __init__(
        self, node: Node, params: SimParams, engine: TickEngine, inputs: Inputs, outputs: Outputs
    ) -> None:
        """Subscribe to commands, and monitor the partner by a timer."""
        self._engine, self._inputs, self._outputs = engine, inputs, outputs
        self._log, self._every = node.get_logger(), params.publish_every
        self._retry = round(1e9 * params.lockstep_retry)
        self._timeout = round(1e9 * params.lockstep_timeout)
        self._glance = 0.5 * params.lockstep_retry
        self.asked_again = 0
        self.gone = False
        self._waiting = Waiting(soon=_SOON)
        library().await_answer(byref(self._waiting), -1)
        self._subscription = subscribe(node, JOINT_COMMANDS, self.on_command, raw=True)
        inputs.read_from(self._subscription.handle.pointer)
        self.ahead: Callable[[Waiting], int] = lambda waiting: Ahead.CANNOT
        steady_timer(node, self._glance, self.look)
        engine.on_jump.append(self.wait)
        engine.on_pause += [outputs.publish, self.wait]

    @property
    def ignored(self) -> int:
        """Number of commands that did not answer a waiting state."""
        return int(self._waiting.ignored)

    def reset_counters(self) -> None:
        """Reset the counters."""
        self.asked_again = self._waiting.ignored = 0

    def on_command(self, raw: bytes) -> None:
        """Process a command, and those that arrive soon after it, for at most ``_STRETCH``.

        Sleeping and waking up takes longer than most answers.
        """
        self._waiting.end = time.monotonic_ns() + _STRETCH
        self._take(raw)
        while time.monotonic_ns() < self._waiting.end and self._answered_soon():
            pass

    def _take(self, raw: bytes) -> None:
        """Tick to the next published state if the command answers the current one."""
        stamp = self._inputs.on_joint_commands(raw, time.time_ns())
        if stamp is None or not library().is_answer(byref(self._waiting), stamp):
            return
        if self.gone:
            self.gone = False
            self._log.info("the partner answers again")
        self._engine.tick_unattended()
        self._finish()

    def _finish(self) -> None:
        """Tick until the next published state, and wait for its answer."""
        engine = self._engine
        while not engine.paused and engine.simulator.arm.step_count % self._every:
            engine.tick_unattended()
        self.wait()

    def _answered_soon(self) -> bool:
        """Process commands that arrive soon; return whether there may be more."""
        if not self.gone and self._waiting.stamp >= 0:
            match self.ahead(self._waiting):
                case Ahead.NOTHING_CAME:
                    return False
                case Ahead.TOLD:
                    self._finish()
                    return True
                case Ahead.ANSWERED:
                    self._engine.tick_unattended()
                    self._finish()
                    return True
        if (soon := self._soon()) is None:
            return False
        self._take(soon)
        return True

    def _soon(self) -> bytes | None:
        """A command that arrives within ``_SOON``; meanwhile other threads may run."""
        if (left := self._inputs.left()) is not None:
            return left
        waiting, is_expected = self._waiting, library().is_expected
        while waiting.stamp >= 0 and is_expected(byref(waiting)):
            taken = self._subscription.handle.take_message(self._subscription.msg_type, True)
            if taken is not None:
                return bytes(taken[0])
            os.sched_yield()
        return None

    def wait(self) -> None:
        """Wait for the answer to the state published last, or for nothing while paused."""
        stamp = -1 if self._engine.paused else self._engine.stamp
        library().await_answer(byref(self._waiting), stamp)

    def look(self) -> None:
        """Publish the state again, or report the partner gone, when it is time."""
        if self._engine.paused:
            self._outputs.repeat(self._glance)
            return
        now = time.monotonic_ns()
        if not self.gone and now - self._waiting.first > self._timeout:
            self.gone = True
            self._log.error(
                f"no answer to the state of {1e-9 * self._engine.stamp:.6f} s for "
                f"{1e-9 * self._timeout:g} s: the partner is gone; time stands still"
            )
        if now - self._waiting.asked > self._retry:
            self.asked_again += 1
            self._waiting.asked = now
            self._outputs.publish()
