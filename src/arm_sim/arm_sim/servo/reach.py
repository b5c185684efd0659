# SPDX-License-Identifier: Apache-2.0
"""Commanded positions end at the joints' stops, and speeds at their limits."""

from __future__ import annotations

import logging

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_dynamics.dynamics.built import too_fast
from arm_sim.servo.command import JointCommand

# Distance beyond a stop in [rad] or [m] that is rounding, and time in [s] without commands beyond
# a joint's limits, after which the next one is told again.
ROUNDING, QUIET = 1e-9, 1.0

_log = logging.getLogger(__name__)


class Reach:
    """Clips commanded positions to the stops, with a warning for each joint.

    Where an arm is beyond its stops, as compliant ones allow, it may be held there.

    Args:
        model: The arm.
        dt: Length of a tick in [s].
    """

    def __init__(self, model: ArmModel, dt: float) -> None:
        self._model, self._quiet = model, QUIET / dt
        self.restart()

    def restart(self) -> None:
        """Forget what was told."""
        self._seen = np.full(self._model.n, -np.inf)  # tick of the last position beyond
        self._fast = -np.inf

    def within(self, command: JointCommand, q: Array, step: int) -> JointCommand:
        """What acts of a command that comes after ``step`` ticks, at positions q, shape (n,)."""
        if fast := too_fast(self._model, command.velocity, 1.0):
            if step - self._fast > self._quiet:
                _log.warning("%s, beyond which its servo does not go", fast)
            self._fast = step
        asked, (lower, upper) = command.position, self._model.stops.place
        if not ((asked < lower) | (asked > upper)).any():
            return command
        reached = np.clip(asked, np.minimum(lower, q), np.maximum(upper, q))
        beyond = abs(reached - asked) > ROUNDING
        for i in np.flatnonzero(beyond & (step - self._seen > self._quiet)).tolist():
            unit = "m" if self._model.joint_types[i] == "prismatic" else "rad"
            _log.warning(
                "position %.6g %s of joint '%s' is beyond its stops and is clipped; allowed: "
                "%.6g to %.6g", asked[i], unit, self._model.joint_names[i], lower[i], upper[i],
            )  # fmt: skip
        self._seen[beyond] = step
        return JointCommand.of_rows(reached, command.velocity, command.effort, command.stamp)
