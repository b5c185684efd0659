# SPDX-License-Identifier: Apache-2.0
"""The equations of a scene, from which quantities of its motions are derived."""

from collections.abc import Callable
from functools import cached_property

from arm_dynamics import ArmModel
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.integrators.methods import METHODS
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.plant.present_dynamics import PresentDynamics
from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.recording.origin import Origin
from arm_sim.recording.second_run import MotionRepeater
from arm_sim.stepping.stepper import Stepper


class Physics:
    """The equations of a scene, built on first use.

    Args:
        build: Returns the equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.

    Attributes:
        choice: As given.
        backend: Likewise.
    """

    def __init__(self, build: Callable[[], Plant], choice: Choice, backend: str) -> None:
        self._build, self.choice, self.backend = build, choice, backend

    @cached_property
    def plant(self) -> Plant:
        """The equation of motion."""
        return self._build()

    @cached_property
    def present(self) -> PresentDynamics:
        """Numeric dynamics with the current tunable quantities, by Pinocchio."""
        return PresentDynamics(self.plant)

    @cached_property
    def energy_account(self) -> EnergyAccount:
        """Computes the energy account of motions, with dynamics of its own, in any thread."""
        own = PresentDynamics(self.plant)
        return EnergyAccount(self.plant, own, self.choice, self.backend)

    @built_once
    def replay_stepper(self) -> Stepper:
        """Ticks under effective commands, to evaluate recorded states."""
        return Stepper(self.plant, self.choice, self.backend, acted=True)

    @cached_property
    def repeater(self) -> MotionRepeater:
        """Repeats motions by other means, to estimate their error."""
        return MotionRepeater(self.plant, self.choice, self.backend)


def physics_of(origin: Origin) -> Physics:
    """The equations of a recording's scene."""
    choice = Choice(METHODS[origin.integrator], origin.dt, origin.tolerance, "as recorded")
    return Physics(lambda: Plant(ArmModel(origin.scene)), choice, "auto")
