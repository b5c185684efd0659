# SPDX-License-Identifier: Apache-2.0
"""Incoming commands and wrenches: checked, and refused with a warning."""

from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from arm_dynamics import ArmError, InvalidInput
from arm_dynamics.exceptions import known_names, plain
from arm_dynamics.logs import Throttled
from arm_dynamics.ros.interfaces import JOINT_COMMANDS, Topic
from arm_dynamics.ros.joint_state import Numbers
from arm_sim.ros.commands.joint_commands import JointCommands
from arm_sim.ros.inputs.command_reader import CommandReader
from arm_sim.ros.inputs.competing_publishers import CompetingPublishers
from arm_sim.ros.inputs.polled_commands import PolledCommands
from arm_sim.ros.interfaces import COMMANDS, WRENCH
from arm_sim.ros.tick_engine import TickEngine

_UNNAMED = "~/commands"  # the source of commands without a header
_NO_STAMP = -1  # of commands without a header


class Inputs:
    """Checks commands and wrenches, and passes them to the engine.

    Attributes:
        reader: Reads efforts, positions and velocities by joint name from serialized JointStates.
        polled: Commands by joint name that are read before each tick.
        refused: Number of commands that were refused.
        refused_wrenches: Number of wrenches that were refused.
        tap: Called with topic and message of every input that is read here.
    """

    def __init__(self, node: Node, engine: TickEngine, competitors: CompetingPublishers) -> None:
        """Prepare; ``competitors`` know whether commands may be for another sim."""
        self._log, self._engine = Throttled(node.get_logger()), engine
        self._competitors, self._resolve = competitors, node.resolve_topic_name
        self._model = engine.simulator.model
        self._joints = JointCommands(self._model, engine.arbiter.admit)
        self.reader = CommandReader(self._model, engine.arbiter, self._log.warning)
        self.refused = self.refused_wrenches = 0
        self.tap: Callable[[Topic, Any], None] = lambda topic, message: None
        self._has_explained = False
        self.polled = PolledCommands(
            engine, self.reader.efforts, self.on_joint_commands,
            lambda: bool(competitors.alarm.message),
        )  # fmt: skip

    def reset_counters(self) -> None:
        """Reset the counters."""
        self.refused = self.refused_wrenches = 0

    def on_joint_commands(self, raw: bytes | None, arrival: int = 0) -> int | None:
        """Make the content of a JointState that arrived at ``arrival`` [ns] the newest command.

        None in place of a message that was lost is refused.

        Returns:
            Its stamp in [ns], or None if it was refused.
        """
        slot = self._engine.commands
        if raw is None:
            self._refuse(InvalidInput("a message was lost"))
            return None
        self.tap(JOINT_COMMANDS, raw)
        try:
            self._catch_up()
            message = self.reader.read(raw)
            self._competitors.check(message.stamp)
            if is_first := not slot.was_sent:
                self._joints.forget()
            command = self._joints.command(message)
        except InvalidInput as error:
            self._refuse(error)
            return None
        if command is not None:
            slot.put(command)
            if is_first:
                self._warn_of_uncommanded(message.commanded)
        self._engine.round_trip.register_answer(message.stamp, arrival)
        return message.stamp

    def _warn_of_uncommanded(self, commanded: frozenset[int]) -> None:
        """Warn of the joints that a first command lacks."""
        names = self._model.joint_names
        if missing := [name for i, name in enumerate(names) if i not in commanded]:
            what = "have no command yet: the brakes are released, and no effort holds them"
            self._log.warning(f"joints {known_names(missing, 8)} {what}")

    def _catch_up(self) -> None:
        """Register efforts of all joints that C has read."""
        if (efforts := self._engine.commands.take_efforts()) is not None:
            self._joints.follow(efforts)
            self.reader.efforts.store(efforts)

    def on_commands(self, message: Float64MultiArray) -> None:
        """Accept efforts in model order."""
        self.tap(COMMANDS, message)
        if not self._has_explained:  # once, since the type does not say what the numbers are
            self._has_explained = True
            units = zip(self._model.joint_names, self._model.command_unit, strict=True)
            efforts = ", ".join(f"{name} [{unit}]" for name, unit in units)
            self._log.info(
                f"numbers on {self._resolve(_UNNAMED)} are taken as efforts: {efforts}; positions "
                f"and velocities are taken from {self._resolve(JOINT_COMMANDS.name)}"
            )
        tau, n = np.array(message.data, float), self._model.n
        try:
            if message.layout.data_offset:
                raise InvalidInput(f"data_offset is {message.layout.data_offset}; allowed: 0")
            if tau.shape != (n,) or not np.isfinite(tau).all():
                raise InvalidInput(f"{tau.size} numbers {tau[:10]}; allowed: {n} finite numbers")
            self._competitors.check(_NO_STAMP)
        except InvalidInput as error:
            self._refuse(error)
            return
        numbers = self.reader.clip(tuple(tau.tolist()))
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

    def _refuse(self, error: InvalidInput) -> None:
        self.refused += 1
        self._log.warning(f"command ignored: {plain(error)}")
