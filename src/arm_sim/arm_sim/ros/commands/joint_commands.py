# SPDX-License-Identifier: Apache-2.0
"""Commands of some joints, merged into one command of all joints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.ros.joint_state import Numbers
from arm_sim.ros.commands.latest import Command
from arm_sim.servo import JointCommand


class JointCommands:
    """The last command of each joint, from messages that name some of them.

    A message commands the joints for which it has a number; the others keep their last command, an
    effort, a velocity or a position. While all joints have efforts, a command consists of efforts
    only. A reader calls ``admit`` or ``note`` for each message, whose numbers ``command`` takes.

    Args:
        model: The arm.
        admit: Decides whether a source may command joints, see ``Arbiter.admit``.
    """

    def __init__(self, model: ArmModel, admit: Callable[[str, frozenset[int]], None]) -> None:
        self._model, self._admit = model, admit
        self._named: frozenset[int] = frozenset()
        self._source = ""
        self.forget()

    def admit(self, source: str, joints: frozenset[int]) -> None:
        """Register the joints of a message of efforts, if its source may command them."""
        self._admit(source, joints)
        self._named = joints

    def note(self, source: str, joints: frozenset[int]) -> None:
        """Register the source of a message that may lack numbers for some of its joints."""
        self._source, self._named = source, joints

    def forget(self) -> None:
        """Discard all commands."""
        self._last: JointCommand | None = None
        self._efforts: Numbers | None = None
        self._commanded: frozenset[int] = frozenset()

    def follow(self, efforts: Numbers) -> None:
        """Register efforts of all joints that were read elsewhere."""
        self._last, self._efforts = None, efforts
        self._commanded = frozenset(range(len(efforts)))

    def without(self) -> list[str]:
        """Names of the joints that have no command."""
        names = self._model.joint_names
        return [name for i, name in enumerate(names) if i not in self._commanded]

    def command(self, stamp: int, numbers: list[Numbers]) -> Command | None:
        """The command of all joints; None if the message, of ``stamp`` in [ns], commands none.

        ``numbers`` are efforts of n joints, merged with those of earlier messages; or efforts,
        positions and velocities, NaN where the message has none.

        Raises:
            InvalidInput: If its source may not command these joints.
        """
        if len(numbers) == 1 and (self._last is None or len(self._named) == self._model.n):
            self._last, self._efforts = None, numbers[0]
            self._commanded |= self._named
            return numbers[0]
        n = self._model.n
        rows, before = np.full((2, 3, n), np.nan)  # efforts, positions, velocities
        rows[: len(numbers)] = numbers
        if len(numbers) == 1:  # the others are from earlier messages
            rows[:, [i for i in range(n) if i not in self._named]] = np.nan
        commanded = np.isfinite(rows).any(axis=0)
        if not commanded.any():
            return None
        joints = frozenset(np.flatnonzero(commanded).tolist())
        if len(numbers) > 1:
            self._admit(self._source, joints)
        self._commanded |= joints
        if self._last is not None:
            before[:] = self._last.effort, self._last.position, self._last.velocity
        elif self._efforts is not None:
            before[0] = self._efforts
        effort, position, velocity = np.where(commanded, rows, before)
        self._last = JointCommand.of_rows(position, velocity, effort, stamp)
        return self._last
