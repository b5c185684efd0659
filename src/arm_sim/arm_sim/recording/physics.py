# SPDX-License-Identifier: Apache-2.0
"""The equations of a recording's scene, from which quantities are derived."""

from __future__ import annotations

from functools import cached_property
from typing import Self

from arm_dynamics import ArmModel
from arm_sim.integrators.methods import METHODS
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.plant.present import PresentDynamics
from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.origin import Origin
from arm_sim.recording.witness import Witness


class Physics:
    """The equations of a recording's scene, built on first use.

    Args:
        origin: Scene and method.
        backend: As for ``Kernel``.

    Attributes:
        origin: Likewise.
    """

    def __init__(self, origin: Origin, backend: str = "auto") -> None:
        self.origin, self._backend = origin, backend

    @classmethod
    def built(
        cls, origin: Origin, plant: Plant, present: PresentDynamics, account: EnergyAccount,
        witness: Witness,
    ) -> Self:  # fmt: skip
        """With parts that exist already."""
        made = cls(origin)
        vars(made).update(
            plant=plant, model=plant.model, present=present, account=account, witness=witness
        )
        return made

    @cached_property
    def model(self) -> ArmModel:
        """The arm."""
        return ArmModel(self.origin.scene)

    @cached_property
    def plant(self) -> Plant:
        """The equation of motion."""
        return Plant(self.model)

    @cached_property
    def present(self) -> PresentDynamics:
        """Its dynamics under tunable quantities."""
        return PresentDynamics(self.plant)

    @cached_property
    def account(self) -> EnergyAccount:
        """Computes the energy account."""
        return EnergyAccount(self.plant, self.present, self._choice, self._backend)

    @cached_property
    def witness(self) -> Witness:
        """Makes second runs."""
        return Witness(self.plant, self._choice, self._backend)

    @property
    def _choice(self) -> Choice:
        origin = self.origin
        return Choice(METHODS[origin.integrator], origin.dt, origin.tolerance, "as recorded")
