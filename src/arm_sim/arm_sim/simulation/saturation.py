# SPDX-License-Identifier: Apache-2.0
"""Warnings of commands that are clipped at their limits."""

import logging

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.command_map import gravity_compensated
from arm_dynamics.arrays import Array

_log = logging.getLogger(__name__)


def clipping_message(model: ArmModel, joint: int, command: float, whose: str = "command") -> str:
    """The warning that a command beyond its limit is clipped.

    Args:
        model: The arm.
        joint: Index of the joint.
        command: The command.
        whose: Whose it is.
    """
    unit, limit = model.command_unit[joint], model.command_limit[joint]
    return (
        f"{whose} {command:.6g} {unit} of joint '{model.joint_names[joint]}' exceeds its limit of "
        f"{limit:.6g} {unit} and is clipped to it"
    )


class SaturationNotice:
    """Warns once that a command was clipped at its limit.

    Args:
        model: The arm.
        whose: Whose commands they are, for the warning.

    Attributes:
        logged: Whether the warning was logged, or there are no limits.
    """

    def __init__(self, model: ArmModel, whose: str = "command") -> None:
        self._model, self._whose = model, whose
        self.logged = not np.isfinite(model.command_limit).any()
        self._compensated = gravity_compensated(model.scene)

    def check(self, command: Array, effort: Array) -> None:
        """Compare commands with the effective ones, of shape (n,) or (k, n)."""
        # Comparing the bytes of a single row takes a tenth of the time; -0.0 is compared again.
        if self.logged or command.tobytes() == effort.tobytes():
            return
        clipped = np.atleast_2d(command) != effort
        if self._compensated:  # the arm's gravity compensation changes commands, too
            clipped &= abs(effort) >= self._model.command_limit
        if not clipped.any():
            return
        joint = int(clipped.any(axis=0).argmax())
        commands = np.atleast_2d(command)[:, joint]
        farthest = float(commands[abs(commands).argmax()])
        message = clipping_message(self._model, joint, farthest, self._whose)
        _log.warning("%s; reported once", message)
        self.logged = True
