# SPDX-License-Identifier: Apache-2.0
"""Clips commanded positions to the joints' stops, and warns of excessive commands."""

import logging

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.plausibility import excessive_velocity
from arm_sim.servo.command import JointCommand

ROUNDING = 1e-9  # [rad] or [m] beyond a stop, of which no warning is due
# Time in [s] without commands beyond a joint's limits, after which the next is logged again
QUIET_TIME = 1.0

_log = logging.getLogger(__name__)


class PositionLimits:
    """Clips commanded positions to the stops, with a warning for each joint.

    Where an arm is beyond its stops, as compliant ones allow, it may be held there.

    Args:
        model: The arm.
        dt: Length of a tick in [s].
    """

    def __init__(self, model: ArmModel, dt: float) -> None:
        self._model, self._quiet_ticks = model, QUIET_TIME / dt
        # Ticks of the last position beyond each joint's stops, and of the last excessive speed
        self._last_beyond, self._last_too_fast = np.full(model.n, -np.inf), -np.inf

    def restart(self) -> None:
        """Forget earlier warnings."""
        self._last_beyond[:] = self._last_too_fast = -np.inf

    def clip(self, command: JointCommand, q: Array, step: int) -> JointCommand:
        """The command that acts, of one that comes after ``step`` ticks, at positions q, (n,)."""
        self._warn_of_speed(command, step)
        position, (lower, upper) = command.position, self._model.stops.place
        if not ((position < lower) | (position > upper)).any():
            return command
        clipped = np.clip(position, np.minimum(lower, q), np.maximum(upper, q))
        beyond = abs(clipped - position) > ROUNDING
        for i in np.flatnonzero(beyond & (step - self._last_beyond > self._quiet_ticks)).tolist():
            unit = self._model.units("rad", "m")[i]
            _log.warning(
                "position %.6g %s of joint '%s' is beyond its stops and is clipped; allowed: "
                "%.6g to %.6g", position[i], unit, self._model.joint_names[i], lower[i], upper[i],
            )  # fmt: skip
        self._last_beyond[beyond] = step
        return JointCommand.of_rows(clipped, command.velocity, command.effort, command.stamp)

    def _warn_of_speed(self, command: JointCommand, step: int) -> None:
        if excess := excessive_velocity(self._model, command.velocity, 1.0):
            if step - self._last_too_fast > self._quiet_ticks:
                _log.warning("%s, beyond which its servo does not go", excess)
            self._last_too_fast = step
