# SPDX-License-Identifier: Apache-2.0
"""Lockstep of simulator and controller: a tick is executed when its state has been answered."""

import time
from ctypes import byref

from rclpy.node import Node

from arm_dynamics.ros.common.endpoints import subscribe
from arm_dynamics.ros.common.executor import steady_timer
from arm_dynamics.ros.interfaces import JOINT_COMMANDS
from arm_sim.ros.inputs.inputs import Inputs
from arm_sim.ros.node_library import TICKS, library
from arm_sim.ros.outputs import Outputs
from arm_sim.ros.sim_params import SimParams
from arm_sim.ros.tick_engine import TickEngine

_SOON = 300_000  # [ns] within which busy-waiting for an answer pays
_STRETCH = 20_000_000  # [ns] after which other callbacks get their turn


class Lockstep:
    """Waits for the command with the stamp of the current state, and repeats the state if needed.

    A state is answered once, by the command with its stamp; a command with another stamp is late
    and causes no tick. An unanswered state is published again, and a partner that does not answer
    for ``lockstep_timeout`` is reported gone; time stands still until one answers. Everything
    happens in the thread that spins the node.

    Attributes:
        repeat_count: Number of states that were published again.
        is_partner_gone: Whether the partner is reported gone.
        waiting: The state whose answer is awaited: ``waiting_t`` of ticks.h, where its fields are.
    """

    def __init__(
        self, node: Node, params: SimParams, engine: TickEngine, inputs: Inputs, outputs: Outputs
    ) -> None:
        """Subscribe to commands, and monitor the partner by a timer."""
        self._engine, self._inputs, self._outputs = engine, inputs, outputs
        self._node, self._log = node, node.get_logger()
        self._is_yielding = False
        self._retry = round(1e9 * params.lockstep_retry)
        self._timeout = round(1e9 * params.lockstep_timeout)
        self._period = 0.5 * params.lockstep_retry
        self.repeat_count, self.is_partner_gone = 0, False
        self.waiting = TICKS.structure("waiting_t")(soon=_SOON, stamp=-1)
        self._subscription = subscribe(node, JOINT_COMMANDS, self.on_command, raw=True)
        inputs.polled.read_from(self._subscription.handle.pointer, self._take_message)
        steady_timer(node, self._period, self.check_partner)
        engine.on.jump.append(self.await_answer)
        engine.on.pause.extend((outputs.publish, self.await_answer))

    def reset_counters(self) -> None:
        """Reset the counters."""
        self.repeat_count = self.waiting.ignored = 0

    def _take_message(self) -> tuple[bytes, int] | None:
        """A message and its arrival in [ns]."""
        message = self._subscription.handle.take_message(self._subscription.msg_type, True)
        return None if message is None else (bytes(message[0]), time.time_ns())

    def on_command(self, raw: bytes) -> None:
        """Process a command, and those that arrive soon after it, for at most ``_STRETCH``.

        Sleeping and waking up takes longer than most answers. For every command that C reads, the
        events executor still has a call queued ahead of new requests: until these are over,
        commands are processed one by one.
        """
        engine, arm = self._engine, self._engine.simulator.arm
        self.waiting.end = 0 if self._is_yielding else time.monotonic_ns() + _STRETCH
        stamp, before = self._inputs.on_joint_commands(raw, time.time_ns()), arm.step_count
        engine.run(
            library().ticks_in_lockstep, byref(self.waiting), -1 if stamp is None else stamp
        )
        if engine.paused:
            self.await_answer()
        ticks = arm.step_count - before
        self._yield_after(ticks)
        if ticks != 0:
            self._note_return()

    def _yield_after(self, ticks: int) -> None:
        """Give other callbacks their turn if more ticks than one were executed."""
        executor = self._node.executor
        if not self._is_yielding and executor is not None and ticks > 1:
            self._is_yielding = True
            executor.create_task(self._end_yield)

    def _note_return(self) -> None:
        if self.is_partner_gone:
            self.is_partner_gone = False
            self._log.info("the partner answers again")

    def _end_yield(self) -> None:
        self._is_yielding = False

    def await_answer(self) -> None:
        """Wait for the answer to the state published last, or for nothing while paused."""
        self.waiting.stamp = -1 if self._engine.paused else self._engine.stamp
        self.waiting.published = self.waiting.first = time.monotonic_ns()

    def check_partner(self) -> None:
        """Publish the state again, or report the partner gone, when it is time."""
        if self._engine.paused:
            self._outputs.repeat(self._period)
            return
        now = time.monotonic_ns()
        if not self.is_partner_gone and now - self.waiting.first > self._timeout:
            self.is_partner_gone = True
            self._log.error(
                f"no answer to the state of {1e-9 * self._engine.stamp:.6f} s for "
                f"{1e-9 * self._timeout:g} s: the partner is gone; time stands still"
            )
        if now - self.waiting.published > self._retry:
            self.repeat_count += 1
            self.waiting.published = now
            self._outputs.publish()
