# SPDX-License-Identifier: Apache-2.0
"""Warning of steps of fixed length whose derivatives differ from those of the motion."""

import logging
from collections.abc import Callable

import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_sim.derivatives.nonsmooth_points import sided_friction
from arm_sim.integrators.linear_response import rate_by_state
from arm_sim.integrators.selection import Choice, fastest_rate
from arm_sim.integrators.stability import local_error
from arm_sim.plant.plant import Plant

_log = logging.getLogger(__name__)


class CoarseSteps:
    """Warns at the beginning, or once of a later state in which transmissions stiffen.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
    """

    def __init__(self, plant: Plant, choice: Choice) -> None:
        self._plant, self._choice = plant, choice
        # The fastest rate in [1/s] as function of the state, until it has caused a warning
        self._rate: Callable[[Array], float] | None = None
        if choice.tolerance is None:
            self._warn_of_sided_friction()
            if not self._warn(fastest_rate(plant)) and _can_stiffen(plant.model):
                self._rate = rate_by_state(plant)

    @property
    def is_watching(self) -> bool:
        """Whether a later state may cause a warning."""
        return self._rate is not None

    def check(self, x: Array) -> None:
        """Warn if a rate at one of these states, shape (b, nx), is too fast."""
        if self._rate and self._warn(max(map(self._rate, x))):
            self._rate = None

    def _warn_of_sided_friction(self) -> None:
        for joint in np.flatnonzero(sided_friction(self._plant)):
            _log.warning(
                "derivatives of time steps in which joint '%s' turns back are those of %s, not of "
                "the motion: its viscous friction differs by direction",
                self._plant.model.joint_names[joint], self._choice.method.name,
            )  # fmt: skip

    def _warn(self, rate: float) -> bool:
        """Warn if what moves at a rate in [1/s] is resolved too coarsely; return whether."""
        method, dt = self._choice.method, self._choice.dt
        error = local_error(method, rate, dt)
        if not error > self._plant.model.scene.sim.accuracy:
            return False
        _log.warning(
            "derivatives are those of %s in steps of dt = %g s: for what answers in %.2g s they "
            "differ from the motion's by %.1g; a tolerance, or a smaller dt, reduces that",
            method.name, dt, 1.0 / rate, min(error, 1.0),
        )  # fmt: skip
        return True


def _can_stiffen(model: ArmModel) -> bool:
    """Whether a transmission stiffens under load, so that rates depend on the state."""
    couplings = (drive.coupling for drive in model.drives if drive)
    return any(coupling and coupling.stiffening > 0.0 for coupling in couplings)
