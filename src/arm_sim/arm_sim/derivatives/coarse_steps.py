# SPDX-License-Identifier: Apache-2.0
"""Warning of steps of fixed length that answer other than the motion to small disturbances."""

from __future__ import annotations

import logging

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.derivatives.nonsmooth_points import sided
from arm_sim.integrators.response import rate_by_state
from arm_sim.integrators.selection import Choice, fastest_rate
from arm_sim.integrators.stability import local_error
from arm_sim.plant.plant import Plant

_log = logging.getLogger(__name__)


class CoarseSteps:
    """Says so at the beginning, or later of states in which transmissions stiffen.

    Attributes:
        rate: The fastest rate by state, while it remains to be looked at; else None.
    """

    def __init__(self, plant: Plant, choice: Choice) -> None:
        self._plant, self._choice = plant, choice
        self.rate = rate_by_state(plant) if self._begin() else None

    def look(self, x: Array) -> None:
        """Look at states, shape (b, nx)."""
        if self.rate and self._warn(max(map(self.rate, x))):
            self.rate = None

    def _begin(self) -> bool:
        """Whether states have to be looked at."""
        if self._choice.tolerance is not None:
            return False
        model = self._plant.model
        for joint in np.flatnonzero(sided(self._plant)):
            _log.warning(
                "derivatives of time steps in which joint '%s' turns back are those of %s, not of "
                "the motion: its viscous friction differs by direction",
                model.joint_names[joint], self._choice.method.name,
            )  # fmt: skip
        told = self._warn(fastest_rate(self._plant))
        couplings = (drive.coupling for drive in model.drives if drive)
        return not told and any(coupling and coupling.stiffening > 0.0 for coupling in couplings)

    def _warn(self, rate: float) -> bool:
        """Say it of what answers at a rate in [1/s]; return whether that is so."""
        method, dt = self._choice.method, self._choice.dt
        off = local_error(method, rate, dt)
        if not off > self._plant.model.scene.sim.accuracy:
            return False
        _log.warning(
            "derivatives are those of %s in steps of dt = %g s: for what answers in %.2g s they "
            "differ from the motion's by %.1g; a tolerance, or a smaller dt, reduces that",
            method.name, dt, 1.0 / rate, min(off, 1.0),
        )  # fmt: skip
        return True
