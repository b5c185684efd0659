# SPDX-License-Identifier: Apache-2.0
"""What contacts take out of a motion, found by computing its ticks again."""

from __future__ import annotations

import numpy as np

from arm_dynamics.model.arm import Array
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.contact import ContactStepper


class ContactLosses:
    """Losses at impacts and by friction of contacts, tick by tick.

    Args:
        plant: The equation of motion of a scene with contacts.
        choice: How it is integrated.
        backend: As for ``Kernel``.
    """

    def __init__(self, plant: Plant, choice: Choice, backend: str) -> None:
        self._stepper = ContactStepper(plant, choice, backend)

    def __call__(self, x: Array, u: Array, p: Array) -> Array:
        """Energy that impacts, and friction, took out in each tick.

        Args:
            x: States before each tick (and perhaps after the last), shape (k+1, nx) or (k, nx).
            u: Torque that acted in each tick, shape (k, n).
            p: Tunable quantities, shape (np,).

        Returns:
            Energies in [J], shape (k, 2); NaN if a tick cannot be computed again.
        """
        stepper, k = self._stepper, len(u)
        trace, effort, error = np.empty((1, x.shape[1])), np.empty((1, u.shape[1])), np.empty(1)
        losses = np.full((k, 2), np.nan)
        stepper.p[:] = p
        for i in range(k):
            stepper.restart()
            stepper.memory.audit = 1
            if stepper.roll(x[i].copy(), u[i].copy(), trace, effort, error) == 1:
                losses[i] = stepper.memory.loss, stepper.memory.friction
        return losses
