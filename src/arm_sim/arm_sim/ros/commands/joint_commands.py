# SPDX-License-Identifier: Apache-2.0
"""Commands of some joints, merged into one command of all joints."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.ros.joint_state import Numbers
from arm_sim.ros.commands.latest import Command
from arm_sim.servo import JointCommand


class JointMessage(NamedTuple):
    """Numbers for some joints.

    Attributes:
        stamp: In [ns].
        numbers: Efforts of n joints, which are those of earlier messages where this one names no
            joint; or efforts, positions and velocities of n joints, NaN where it has none.
        source: Who sent it, see ``Arbiter``.
        joints: Indices of the joints that it names.
    """

    stamp: int
    numbers: list[Numbers]
    source: str
    joints: frozenset[int]

    @property
    def commanded(self) -> frozenset[int]:
        """Indices of the joints for which it has a number."""
        if len(self.numbers) == 1:
            return self.joints
        return frozenset(np.flatnonzero(np.isfinite(self.numbers).any(axis=0)).tolist())


class JointCommands:
    """The last command of each joint, from messages that name some of them.

    A message commands the joints for which it has a number; the others keep their last command, an
    effort, a velocity or a position. While all joints have efforts, a command consists of efforts
    only.

    Args:
        model: The arm.
        admit: Decides whether a source may command joints, see ``Arbiter.admit``.
    """

    def __init__(self, model: ArmModel, admit: Callable[[str, frozenset[int]], None]) -> None:
        self._model, self._admit = model, admit
        self._last: JointCommand | None = None
        self._efforts: Numbers | None = None

    def forget(self) -> None:
        """Discard all commands."""
        self._last = self._efforts = None

    def follow(self, efforts: Numbers) -> None:
        """Register efforts of all joints that were read elsewhere."""
        self._last, self._efforts = None, efforts

    def command(self, message: JointMessage) -> Command | None:
        """The command of all joints; None if the message commands none.

        Raises:
            InvalidInput: If the source of positions or velocities may not command these joints;
                that of efforts has been admitted.
        """
        numbers, joints, n = message.numbers, message.commanded, self._model.n
        efforts_only = len(numbers) == 1
        if efforts_only and (self._last is None or len(joints) == n):
            self._last, self._efforts = None, numbers[0]
            return numbers[0]
        if not joints:
            return None
        if not efforts_only:
            self._admit(message.source, joints)
        rows, before = np.full((2, 3, n), np.nan)  # efforts, positions, velocities
        rows[: len(numbers)] = numbers
        commanded = np.zeros(n, dtype=bool)
        commanded[list(joints)] = True
        if self._last is not None:
            before[:] = self._last.effort, self._last.position, self._last.velocity
        elif self._efforts is not None:
            before[0] = self._efforts
        effort, position, velocity = np.where(commanded, rows, before)
        self._last = JointCommand.of_rows(position, velocity, effort, message.stamp)
        return self._last
