# SPDX-License-Identifier: Apache-2.0
"""Incoming commands and wrenches: checked, and refused with a warning."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import addressof
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
from arm_dynamics.ros.common.polled_subscription import PolledSubscription
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, Topic
from arm_dynamics.ros.joint_state import FAILED, Clip, Expected, JointStateReader, Numbers
from arm_sim.inputs import clipped
from arm_sim.ros.command_reader import CommandReader
from arm_sim.ros.commands.joint_commands import JointCommands
from arm_sim.ros.interfaces import COMMANDS, WRENCH
from arm_sim.ros.rivals import Rivals
from arm_sim.ros.tick_engine import TickEngine
from arm_sim.ros.timing.round_trip import RoundTrip

_UNNAMED = "~/commands"  # the source of commands without a header
_NEVER = -1  # their stamp
AT_ONCE = JOINT_COMMANDS.subscribe.depth  # messages read in one tick


class Inputs:
    """Commands and wrenches from topics. C reads most commands; others are read here.

    Attributes:
        reader: Reads efforts, positions and velocities by joint name from serialized JointStates.
        round_trip: Time from a state to its command.
        refused: Number of commands that were refused.
        refused_wrenches: Number of wrenches that were refused.
        rivals: Know of other sims, for which a command may be; None if there cannot be any.
        tap: Called with topic and message of every input that is read here.
    """

    def __init__(self, node: Node, engine: TickEngine) -> None:
        self._log, self._engine = Throttled(node.get_logger()), engine
        self._model = engine.simulator.model
        self._limit = self._model.command_limit.tolist()
        self._joints = JointCommands(self._model, engine.arbiter.admit)
        names, clip = self._model.joint_names, Clip(self._limit, self._clipped)
        efforts = Expected(names, ("effort",), partial=True)
        every = Expected(names, ("effort", "position", "velocity"), partial=True, gaps=True)
        self.reader = CommandReader(
            JointStateReader(efforts, self._joints.admit, clip),
            JointStateReader(every, self._joints.note, clip),
        )
        self._newest: PolledSubscription | None = None
        self._take_again: Callable[[], tuple[bytes, int] | None] = lambda: None
        self.round_trip, self.refused, self.refused_wrenches = RoundTrip(), 0, 0
        self.rivals: Rivals | None = None
        self.tap: Callable[[Topic, Any], None] = lambda topic, message: None
        self._explained = False
        engine.ticks.trip = addressof(self.round_trip)
        engine.ticks.answer(read=self._read)
        engine.ticks.refresh.append(self._refresh)
        for listeners in (engine.on_jump, engine.on_pause, engine.on_staleness):
            listeners.append(self.round_trip.forget)

    def open(self, node: Node) -> None:
        """Subscribe to efforts by joint name, to be read before each tick."""
        self._newest = newest = PolledSubscription(node, JOINT_COMMANDS)
        self.read_from(newest.pointer, newest.take)
        self._engine.ticks.at_once = AT_ONCE

    def read_from(self, place: int, take_again: Callable[[], tuple[bytes, int] | None]) -> None:
        """Let C read the messages of an ``rcl_subscription_t``.

        ``take_again`` returns a message and its arrival in [ns] after C has failed to, or raises
        why.
        """
        self.reader.efforts.open(place)
        self._take_again = take_again
        self._engine.ticks.source, self._engine.ticks.reader = self.reader.efforts.places

    def close(self) -> None:
        """End the subscription."""
        self._engine.ticks.at_once = 0
        self.reader.efforts.close()
        if self._newest is not None:
            self._newest.close()
            self._newest = None

    def reset_counters(self) -> None:
        """Reset the counters."""
        self.round_trip.reset()
        self.refused = self.refused_wrenches = 0

    def _refresh(self) -> None:
        """Let C know whose messages it may accept."""
        ticks, leader = self._engine.ticks, self._engine.arbiter.leader
        watched = self.rivals is not None and bool(self.rivals.alarm.message)
        delayed = self._engine.commands.line is not None
        if leader is not None and len(leader[1]) == self._model.n and not (watched or delayed):
            whole = self.reader.efforts.whole_from(leader[0])
            ticks.leads[: len(whole)] = whole
        else:
            ticks.leads[:] = [0] * len(ticks.leads)

    def _read(self) -> bool:
        """Process the message that C has taken and leaves to Python.

        Returns whether no newer one is expected: after the answer to the newest state none is,
        unless there are other sources. A read without result takes as long as one with a message.
        """
        ticks, reader = self._engine.ticks, self.reader.efforts
        arrived = self._take_again() if ticks.outcome == FAILED else (reader.raw, reader.arrival)
        if arrived is None:
            self._refuse(InvalidInput("a message was lost"))
            return False
        stamp = self.on_joint_commands(*arrived)
        ticks.stamp = -1 if stamp is None else stamp
        answers = bool(stamp) and stamp == self.round_trip.newest
        return answers and self._engine.arbiter.alone

    def on_joint_commands(self, raw: bytes, arrival: int = 0) -> int | None:
        """Make the content of a JointState that arrived at ``arrival`` [ns] the newest command.

        Returns:
            Its stamp in [ns], or None if it was refused.
        """
        slot = self._engine.commands
        self.tap(JOINT_COMMANDS, raw)
        try:
            self._catch_up()
            stamp, numbers = self.reader.read(raw)
            if self.rivals is not None:
                self.rivals.check(stamp)
            if slot.empty:
                self._joints.forget()
            command = self._joints.command(stamp, numbers)
        except InvalidInput as error:
            self._refuse(error)
            return None
        if command is not None:
            slot.put(command)
        self.round_trip.answered(stamp, arrival)
        return stamp

    def _catch_up(self) -> None:
        """Register efforts of all joints that C has read."""
        if (efforts := self._engine.commands.read()) is not None:
            self._joints.follow(efforts)
            self.reader.efforts.keep(efforts)

    def on_commands(self, message: Float64MultiArray) -> None:
        """Accept efforts in model order."""
        self.tap(COMMANDS, message)
        if not self._explained:  # once, since the type does not say what the numbers are
            self._explained = True
            units = zip(self._model.joint_names, self._model.command_unit, strict=True)
            efforts = ", ".join(f"{name} [{unit}]" for name, unit in units)
            self._log.info(
                f"numbers on {_UNNAMED} are taken as efforts: {efforts}; positions and velocities "
                f"are taken from {JOINT_COMMANDS.name}"
            )
        tau, n = np.array(message.data, float), self._model.n
        try:
            if message.layout.data_offset:
                raise InvalidInput(f"data_offset is {message.layout.data_offset}; allowed: 0")
            if tau.shape != (n,) or not np.isfinite(tau).all():
                raise InvalidInput(f"{tau.size} numbers {tau[:10]}; allowed: {n} finite numbers")
            if self.rivals is not None:
                self.rivals.check(_NEVER)
        except InvalidInput as error:
            self._refuse(error)
            return
        numbers = tuple(tau.tolist())
        if any_beyond(numbers, self._limit):
            numbers = self._clipped(numbers)
        self._engine.queue.post(lambda: self._put_efforts(numbers))

    def _put_efforts(self, numbers: Numbers) -> None:
        """Make efforts of all joints from an unnamed source the newest command."""
        try:
            self._engine.arbiter.admit(_UNNAMED, frozenset(range(len(numbers))))
        except InvalidInput as error:
            self._refuse(error)
            return
        self._catch_up()
        self._joints.forget()
        self._engine.commands.put(numbers)

    def on_wrench(self, message: WrenchStamped) -> None:
        """Apply a wrench to the frame in the header."""
        self.tap(WRENCH, message)
        force, moment = message.wrench.force, message.wrench.torque
        wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        try:
            self._engine.push(message.header.frame_id, wrench)
        except ArmError as error:
            self.refused_wrenches += 1
            self._log.warning(f"wrench ignored: {plain(error)}")

    def _clipped(self, tau: Numbers) -> Numbers:
        """Clip efforts to their limits, with a warning."""
        limits = self._limit
        joint = next(i for i, limit in enumerate(limits) if abs(tau[i]) > limit)
        self._log.warning(clipped(self._model, joint, tau[joint]))
        pairs = zip(tau, limits, strict=True)
        return tuple(x if abs(x) <= limit or x != x else copysign(limit, x) for x, limit in pairs)

    def _refuse(self, error: InvalidInput) -> None:
        self.refused += 1
        self._log.warning(f"command ignored: {plain(error)}")
