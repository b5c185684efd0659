# SPDX-License-Identifier: Apache-2.0
"""What surrounds a controller: limits of its torques, and torques of the reference."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array, positive_limits
from arm_dynamics.attributes import sealed
from arm_dynamics.control.compiled_law import CompiledLaw, compiled_law
from arm_dynamics.control.controller import AnyController, ArmState, added_torques, restart
from arm_dynamics.control.law import LawInput, Parts, Wrapper
from arm_dynamics.trajectory.reference import Reference


@sealed
class Saturated:
    """Clips torques at limits and reports it.

    Clipping a joint's torque changes the direction of the arm's acceleration: a controller that
    cancels the dynamics loses its error equation while ``saturated`` is true anywhere. Compiled
    code applies the limits after its law (``CompiledLaw.limit``): they are in no formula, so this
    is no ``Wrapper``.

    Attributes:
        control: The controller.
    """

    def __init__(self, control: AnyController, limit: ArrayLike, n: int) -> None:
        """Set limits in [N m] or [N], positive, inf for none, a number or shape (n,)."""
        self.control, self._limit = control, positive_limits("limit", limit, n)
        self._unlimited = np.zeros(n)

    @property
    def unlimited_torque(self) -> Array:
        """Last torque of the controller, before the limits, shape (n,)."""
        return self._unlimited.copy()

    @property
    def saturated(self) -> Array:
        """Joints that were clipped in the last tick, shape (n,)."""
        return np.asarray(abs(self._unlimited) > self._limit)

    def restart(self) -> None:
        """Let the controller forget the past."""
        restart(self.control)

    def compiled(self) -> CompiledLaw | None:
        """Return the controller with its limits; None if it is not compiled."""
        if (law := compiled_law(self.control)) is None:
            return None
        inner = np.inf if law.limit is None else law.limit
        return replace(law, limit=np.minimum(self._limit, inner))

    def torque(self, state: ArmState, reference: Any) -> Array:
        """Return joint torques within the limits in [N m] or [N], shape (n,)."""
        self._unlimited = self.control.torque(state, reference)
        # As ``equations.elementary.clipped``; np.clip takes three times as long.
        return np.asarray(np.minimum(np.maximum(self._unlimited, -self._limit), self._limit))


class WithAddedTorques(Wrapper):
    """A joint controller with the torques of the reference added."""

    def torque(self, state: ArmState, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        tau, added = self.control.torque(state, reference), added_torques(reference, self._n)
        return tau if added is None else np.asarray(tau + added)

    def adapt(self, tau: Any, inputs: LawInput, tuning: Parts, memory: Parts) -> tuple[Any, Parts]:
        """The controller's torques and the reference's."""
        return tau + inputs.desired.tau, memory
