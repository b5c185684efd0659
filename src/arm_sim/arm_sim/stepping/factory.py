# SPDX-License-Identifier: Apache-2.0
"""Which machinery steps a scene."""

from __future__ import annotations

from functools import partial

from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.plant import Plant
from arm_sim.stepping.contact import ContactStepper
from arm_sim.stepping.dry_friction import DryStepper
from arm_sim.stepping.stepper import AdaptiveStepper, FixedStepper, Stepper


class Steppers:
    """The stepper of a scene, and the one that has a controller compiled in.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
    """

    def __init__(self, plant: Plant, choice: Choice, backend: str) -> None:
        self._make = partial(make_stepper, plant, choice, backend)
        self.plain = self._make()
        self._controlled: tuple[CompiledControl, Stepper] | None = None

    def restart(self) -> None:
        """Forget what was learned from earlier steps."""
        self.plain.restart()
        self._controlled = None

    def with_control(self, control: CompiledControl) -> Stepper:
        """The stepper that has ``control`` compiled in; the last one is kept."""
        if self._controlled is None or self._controlled[0] is not control:
            self._controlled = control, self._make(control)
        self._controlled[1].p[:] = self.plain.p
        return self._controlled[1]


def make_stepper(
    plant: Plant, choice: Choice, backend: str, control: CompiledControl | None = None
) -> Stepper:
    """The stepper for a scene's physics and a choice of method.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
        control: Controller to compile in, if any.

    Returns:
        A stepper.
    """
    if plant.contact is not None:
        return ContactStepper(plant, choice, backend, control)
    if plant.reaction is not None:
        return DryStepper(plant, choice, backend, control)
    if choice.tolerance is None:
        return FixedStepper(plant, choice.method, choice.dt, backend, control)
    return AdaptiveStepper(plant, choice.method, choice.dt, choice.tolerance, backend, control)
