# SPDX-License-Identifier: Apache-2.0
"""The equations of a recording's scene, from which quantities are derived."""

from __future__ import annotations

from functools import cached_property

from arm_dynamics import ArmModel
from arm_sim.integrators.methods import METHODS
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.plant.present import PresentDynamics
from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.origin import Origin
from arm_sim.recording.witness import Witness


class Physics:
    """The equations of a recording's scene, built on first use; of a run its ``CompiledScene``.

    Args:
        origin: Scene and method.

    Attributes:
        origin: Likewise.
    """

    def __init__(self, origin: Origin) -> None:
        self.origin = origin

    @cached_property
    def plant(self) -> Plant:
        """The equation of motion."""
        return Plant(ArmModel(self.origin.scene))

    @cached_property
    def present(self) -> PresentDynamics:
        """Its dynamics under tunable quantities."""
        return PresentDynamics(self.plant)

    @cached_property
    def energy_account(self) -> EnergyAccount:
        """Computes the energy account."""
        return EnergyAccount(self.plant, self.present, self._choice, "auto")

    @cached_property
    def witness(self) -> Witness:
        """Makes second runs."""
        return Witness(self.plant, self._choice, "auto")

    @property
    def _choice(self) -> Choice:
        origin = self.origin
        return Choice(METHODS[origin.integrator], origin.dt, origin.tolerance, "as recorded")
