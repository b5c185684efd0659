# SPDX-License-Identifier: Apache-2.0
"""Feed-forward torques that a trajectory brings along."""

from __future__ import annotations

from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.control.compiled_law import AroundLaw
from arm_dynamics.control.computed_torque import Controller, Moving, Parts, added_torques
from arm_dynamics.trajectory.reference import Reference


class WithAddedTorques(AroundLaw):
    """A joint controller with the torques of the reference added.

    Attributes:
        control: The controller.
    """

    def __init__(self, control: Controller[Reference], n: int) -> None:
        """Take any joint controller of an arm with n joints."""
        super().__init__(control)
        self._n = n

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,)."""
        tau, added = self.control.torque(state, reference), added_torques(reference, self._n)
        return tau if added is None else np.asarray(tau + added)

    def formula(
        self, rigid: Any, q: Any, v: Any, desired: Reference, *numbers: Any
    ) -> tuple[Any, Parts]:
        """The controller's torques and the reference's; see ``compiled_law.Law``."""
        tau, after = self._law.formula(rigid, q, v, desired, *numbers)
        return tau + desired.tau, after
