# SPDX-License-Identifier: Apache-2.0
"""Incoming commands and wrenches: checked, and refused with a warning."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import copysign
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from arm_dynamics import ArmError, InvalidInput
from arm_dynamics.arrays import any_beyond
from arm_dynamics.exceptions import plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, Topic
from arm_dynamics.ros.joint_state import JointStateReader, JointStateSource, Numbers
from arm_sim.inputs import clipped
from arm_sim.ros.commands.joint_commands import JointCommands
from arm_sim.ros.interfaces import COMMANDS, WRENCH
from arm_sim.ros.rivals import Rivals
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.latency import RoundTrip

_UNNAMED = "~/commands"  # the source of commands without a header
_NEVER = -1  # their stamp
AT_ONCE = JOINT_COMMANDS.subscribe.depth  # messages read in one tick


class Inputs:
    """Passes commands and wrenches to the engine, which requests commands before each tick.

    Attributes:
        reader: Reads efforts, positions and velocities by joint name from serialized JointStates.
        source: Source of these messages for the engine; None if there is none.
        round_trip: Time from a state to its command.
        refused: Number of commands that were refused.
        refused_wrenches: Number of wrenches that were refused.
        rivals: Know of other sims, for which a command may be; None if there cannot be any.
        tap: Called with topic and message of every input, if set.
    """

    def __init__(self, node: Node, engine: TickEngine) -> None:
        self._log, self._engine = Throttled(node.get_logger()), engine
        self._model = engine.simulator.model
        self._limit = self._model.command_limit.tolist()
        self._joints = JointCommands(self._model, engine.arbiter.admit)
        ways = {"partial": True, "extra": False, "limit": self._limit, "beyond": self._cut}
        names, every = self._model.joint_names, ("effort", "position", "velocity")
        references = JointStateReader(names, every, gaps=True, admit=self._joints.note, **ways)
        self.reader = JointStateReader(
            names, ("effort",), other=references, admit=self._joints.admit, **ways
        )
        self.source: JointStateSource | None = None
        self.round_trip, self.refused, self.refused_wrenches = RoundTrip(), 0, 0
        self.rivals: Rivals | None = None
        self.tap: Callable[[Topic, Any], None] | None = None
        self._warned = False
        engine.read_commands = self._read_waiting
        for listeners in (engine.on_jump, engine.on_pause, engine.on_staleness):
            listeners.append(self.round_trip.forget)

    def open(self, node: Node) -> None:
        """Subscribe to efforts by joint name, to be read before each tick."""
        self.source = JointStateSource(node, JOINT_COMMANDS, self.reader)

    def follow(self, efforts: Numbers) -> None:
        """Register efforts of all joints that were read elsewhere."""
        self._joints.follow(efforts)
        self.reader.keep(efforts)

    def read_from(self, subscription: int) -> None:
        """Let compiled code read the messages of an ``rcl_subscription_t``."""
        self.reader.open(subscription)

    def left(self) -> bytes | None:
        """The message that compiled code has received but not processed, if there is one."""
        reader = self.reader
        if not reader.left:
            return None
        reader.next()
        return reader.raw

    def listen(self, tap: Callable[[Topic, Any], None]) -> None:
        """Pass every input to ``tap`` from now on, unchanged."""
        self.tap = tap
        if self.source is not None:
            self.source.tap = partial(tap, JOINT_COMMANDS)

    def close(self) -> None:
        """End the subscription."""
        self.reader.close()
        if self.source is not None:
            self.source.close()
            self.source = None

    def reset_counters(self) -> None:
        """Reset the counters."""
        self.round_trip.reset()
        self.refused = self.refused_wrenches = 0

    def _read_waiting(self) -> None:
        """Read the commands since the last tick; the newest that is admitted takes effect.

        After the answer to the newest state no more are read, unless there are other sources: a
        read without result takes as long as one with a message.
        """
        for _ in range(AT_ONCE):
            try:
                if self.source is None or (taken := self.source.take()) is None:
                    return
                arrival, (stamp, numbers) = taken
                self._put(stamp, numbers)
            except InvalidInput as error:
                self._refuse(error)
                continue
            if self.round_trip.answered(stamp, arrival) and self._engine.arbiter.alone:
                return

    def on_joint_commands(self, raw: bytes, arrival: int = 0) -> int | None:
        """Accept a command by joint name from a JointState that arrived at ``arrival`` [ns].

        Returns:
            Its stamp in [ns], or None if it was refused.
        """
        if self.tap is not None:
            self.tap(JOINT_COMMANDS, raw)
        try:
            stamp, numbers = self.reader.read(raw)
            self._put(stamp, numbers)
        except InvalidInput as error:
            self._refuse(error)
            return None
        self.round_trip.answered(stamp, arrival)
        return stamp

    def _put(self, stamp: int, numbers: list[Numbers]) -> None:
        """Make the content of a JointState the newest command."""
        if self.rivals is not None:
            self.rivals.check(stamp)
        slot = self._engine.commands
        if slot.empty:
            self._joints.forget()
        command = self._joints.merged(stamp, numbers)
        if command is not None:
            slot.put(command)

    def on_commands(self, message: Float64MultiArray) -> None:
        """Accept efforts in model order."""
        if self.tap is not None:
            self.tap(COMMANDS, message)
        self._tell_meaning()
        tau, n = np.array(message.data, float), self._model.n
        try:
            if message.layout.data_offset:
                raise InvalidInput(f"data_offset is {message.layout.data_offset}; allowed: 0")
            if tau.shape != (n,) or not np.isfinite(tau).all():
                raise InvalidInput(f"{tau.size} numbers {tau[:10]}; allowed: {n} finite numbers")
            if self.rivals is not None:
                self.rivals.check(_NEVER)
            self._engine.arbiter.admit(_UNNAMED, frozenset(range(n)))
        except InvalidInput as error:
            self._refuse(error)
            return
        numbers = tuple(tau.tolist())
        self._joints.forget()
        self._engine.commands.put(
            self._cut(numbers) if any_beyond(numbers, self._limit) else numbers
        )
        self._engine.queue.ring()

    def _tell_meaning(self) -> None:
        """Log once what numbers on ``~/commands`` are taken for, since the type does not say."""
        if self._warned:
            return
        self._warned = True
        units = zip(self._model.joint_names, self._model.command_unit, strict=True)
        efforts = ", ".join(f"{name} [{unit}]" for name, unit in units)
        self._log.info(
            f"numbers on {_UNNAMED} are taken as efforts: {efforts}; positions and velocities are "
            f"taken from {JOINT_COMMANDS.name}"
        )

    def on_wrench(self, message: WrenchStamped) -> None:
        """Apply a wrench to the frame in the header."""
        if self.tap is not None:
            self.tap(WRENCH, message)
        force, moment = message.wrench.force, message.wrench.torque
        wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        try:
            self._engine.push(message.header.frame_id, wrench)
        except ArmError as error:
            self.refused_wrenches += 1
            self._log.warning(f"wrench ignored: {plain(error)}")

    def _cut(self, tau: Numbers) -> Numbers:
        """Clip efforts to their limits, with a warning."""
        limits = self._limit
        joint = next(i for i, limit in enumerate(limits) if abs(tau[i]) > limit)
        self._log.warning(clipped(self._model, joint, tau[joint]))
        pairs = zip(tau, limits, strict=True)
        return tuple(x if abs(x) <= limit or x != x else copysign(limit, x) for x, limit in pairs)

    def _refuse(self, why: InvalidInput) -> None:
        self.refused += 1
        self._log.warning(f"command ignored: {plain(why)}")
