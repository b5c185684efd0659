# SPDX-License-Identifier: Apache-2.0
"""Torques and pushes that come in on topics: checked, and refused with a word."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import any_beyond
from arm_dynamics.ros.joint_state.compiled import make_reader, make_source
from arm_dynamics.ros.joint_state.serialization import Numbers
from arm_dynamics.ros.joint_state.topics import JointStateSource
from arm_sim.external_wrench import ExternalWrenches
from arm_sim.ros import interfaces
from arm_sim.ros.commands.arbiter import Arbiter
from arm_sim.ros.commands.latest import Commands
from arm_sim.ros.tick_queue import Errands
from arm_sim.runtime_changes import EXTERNAL, external_change
from arm_sim.simulator import Simulator

_THROTTLE = 2.0  # [s] between warnings of one kind
BARE = "~/commands"  # the source of commands that cannot name one


class CommandInput:
    """Reads commands into the slot for torques.

    Attributes:
        arbiter: Who may command.
        passed_over: How many commands were refused.
    """

    def __init__(
        self, node: Node, simulator: Simulator, commands: Commands, patience: int
    ) -> None:
        """Prepare; ``patience`` is the number of ticks after which a silent source is gone."""
        self._log, self._simulator, self._commands = node.get_logger(), simulator, commands
        self.arbiter, self.passed_over = Arbiter(patience), 0
        names, self._limit = simulator.joint_names, simulator.model.command_limit.tolist()
        self._reader = make_reader(
            names, ("effort",), partial=True, extra=False, admit=self.arbiter.admit,
            limit=self._limit, beyond=self._say_cut,
        )  # fmt: skip
        self._all = frozenset(range(simulator.n))
        self._source: JointStateSource | None = None

    def open(self, node: Node) -> None:
        """Listen to efforts by joint name, for a loop that asks with ``next``."""
        self._source = make_source(node, interfaces.JOINT_COMMANDS, self._reader)

    def close(self) -> None:
        """Listen no more."""
        if self._source is not None:
            self._source.close()
            self._source = None

    def next(self) -> tuple[int, int | None] | None:
        """Take the next efforts by joint name that came; None if none did.

        Returns:
            The system time they came at and their stamp, both in [ns]; no stamp if refused.
        """
        try:
            if self._source is None or (taken := self._source.take()) is None:
                return None
        except InvalidInput as error:
            self._refuse(error)
            return 0, None
        arrival, (stamp, (tau,)) = taken
        self._commands.put(tau)
        return arrival, stamp

    def joint_command(self, raw: bytes) -> int | None:
        """Take efforts by joint name from a serialized JointState.

        Returns:
            Its stamp in [ns], or None if it was refused.
        """
        try:
            stamp, (tau,) = self._reader.read(raw)
        except InvalidInput as error:
            self._refuse(error)
            return None
        self._commands.put(tau)
        return stamp

    def bare_command(self, message: Float64MultiArray) -> None:
        """Take efforts in model order."""
        tau, n = np.array(message.data, float), self._simulator.n
        try:
            if tau.shape != (n,) or not np.isfinite(tau).all():
                raise InvalidInput(
                    f"{tau.size} numbers {tau[:10]}; allowed are {n} finite numbers"
                )
            self.arbiter.admit(BARE, self._all)
        except InvalidInput as error:
            self._refuse(error)
            return
        numbers = tuple(tau.tolist())
        if any_beyond(numbers, self._limit):
            self._say_cut(numbers)
        self._commands.put(numbers)

    def _say_cut(self, tau: Numbers) -> None:
        simulator = self._simulator
        joint = next(i for i, limit in enumerate(self._limit) if abs(tau[i]) > limit)
        self._log.warning(
            f"effort {tau[joint]:.6g} of joint '{simulator.joint_names[joint]}' is beyond its "
            f"limit {self._limit[joint]:.6g} {simulator.model.command_unit[joint]} and is cut "
            "to it",
            throttle_duration_sec=_THROTTLE,
        )

    def _refuse(self, why: Any) -> None:
        self.passed_over += 1
        self._log.warning(f"command passed over: {why}", throttle_duration_sec=_THROTTLE)


class PushInput:
    """Reads wrenches, and puts their torques on the simulation while they act.

    Attributes:
        ready: Whether a wrench has ever come that could be used.
        refused: How many wrenches were refused.
    """

    def __init__(
        self, node: Node, simulator: Simulator, errands: Errands, timeout: int, reference: str
    ) -> None:
        """Prepare; nothing is computed before the first wrench comes.

        Args:
            node: For its log.
            simulator: What is pushed.
            errands: The way to the thread that ticks.
            timeout: Ticks that a wrench acts.
            reference: ``local`` or ``local_world_aligned``, see ``ExternalWrenches``.
        """
        self._log, self._simulator, self._errands = node.get_logger(), simulator, errands
        self._wrenches = ExternalWrenches(simulator.dynamics, reference)
        self._timeout, self.ready, self._pushing = timeout, False, False
        self.refused = 0

    @property
    def active(self) -> tuple[str, ...]:
        """Frames that are pushed."""
        return self._wrenches.active

    def on_wrench(self, message: WrenchStamped) -> None:
        """Push the frame that the header names."""
        force, moment = message.wrench.force, message.wrench.torque
        values = [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        try:
            if not self.ready:  # building takes a second, so not in the thread that ticks
                ExternalWrenches(self._simulator.dynamics).push(message.header.frame_id, values, 0)
                self._errands.run(external_change(self._simulator))
                self.ready = True
            self._errands.run(lambda: self._push(message.header.frame_id, values))
        except InvalidInput as error:
            self.refused += 1
            self._log.warning(f"wrench passed over: {error}", throttle_duration_sec=_THROTTLE)

    def _push(self, frame: str, values: list[float]) -> None:
        self._wrenches.push(frame, values, self._simulator.step_count + self._timeout - 1)

    def before_tick(self) -> np.ndarray | None:
        """Put the pushes on the next tick; return their torques, None if nobody pushes."""
        if not (self._wrenches.active or self._pushing):
            return None
        simulator = self._simulator
        tau = self._wrenches.torque(simulator.x[: simulator.n], simulator.step_count)
        self._simulator.set_parameter(EXTERNAL, tau)
        self._pushing = bool(self._wrenches.active)
        return tau

    def clear(self) -> None:
        """Let go."""
        self._wrenches.clear()
