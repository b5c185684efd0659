# SPDX-License-Identifier: Apache-2.0
"""A scene made ready to run: equations, compiled ticks, and what follows from them on demand."""

from __future__ import annotations

from functools import cached_property

from arm_dynamics import ArmModel, Dynamics
from arm_sim.integrators.selection import Choice
from arm_sim.plan import Plan
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.plant import Plant
from arm_sim.recording.energy_account import EnergyAccount
from arm_sim.stepping.linearization import Linearizer
from arm_sim.stepping.rollout import Rollouts
from arm_sim.stepping.stepper import Stepper


class CompiledScene:
    """Everything built from one plant and one choice of method; replaced as a whole, not changed.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
        model: The arm that ``dynamics`` and the energy account speak of, where it is not the
            plant's: a tunable payload or friction has changed. None for the plant's.
        stepper: One that was built already; None builds it.
    """

    def __init__(
        self,
        plant: Plant,
        choice: Choice,
        backend: str,
        model: ArmModel | None = None,
        stepper: Stepper | None = None,
    ) -> None:
        self.plant, self.choice, self.backend = plant, choice, backend
        self.stepper = stepper or Stepper(plant, choice, backend)
        self.model = model or plant.model
        self._controlled: tuple[CompiledControl, Stepper] | None = None

    def of(self, model: ArmModel) -> CompiledScene:
        """The same ticks for an arm with another payload or friction."""
        return CompiledScene(self.plant, self.choice, self.backend, model, self.stepper)

    def restart(self) -> None:
        """Forget what was learned from earlier ticks."""
        self.stepper.restart()
        self._controlled = None

    def controlled(self, control: CompiledControl) -> Stepper:
        """The stepper that has ``control`` compiled in; the last one is kept."""
        if self._controlled is None or self._controlled[0] is not control:
            stepper = Stepper(self.plant, self.choice, self.backend, control)
            self._controlled = control, stepper
        self._controlled[1].p[:] = self.stepper.p
        return self._controlled[1]

    @cached_property
    def dynamics(self) -> Dynamics:
        """Numeric dynamics of the arm as it is now, by Pinocchio."""
        return Dynamics(self.model)

    @cached_property
    def energy_account(self) -> EnergyAccount:
        """What keeps the energy account of motions."""
        return EnergyAccount(self.plant, self.dynamics, self.choice, self.backend)

    @cached_property
    def plan(self) -> Plan:
        """What a tick computes, what it skips, and why."""
        return Plan(self.plant, self.choice, self.stepper)

    @cached_property
    def linearizer(self) -> Linearizer:
        """Exact derivatives of ticks."""
        return Linearizer(self.plant, self.choice)

    @cached_property
    def rollouts(self) -> Rollouts:
        """Many arms at once."""
        return Rollouts(self.plant, self.choice, self.backend)
