# SPDX-License-Identifier: Apache-2.0
"""Wrenches on frames of a running arm."""

from collections.abc import Callable

from numpy.typing import ArrayLike

from arm_sim.external_wrench import ExternalWrenches
from arm_sim.plant.parameters import EXTERNAL
from arm_sim.simulation.runtime_changes import Change, external_change
from arm_sim.simulation.simulator import Simulator


class AppliedWrenches(ExternalWrenches):
    """Wrenches on frames, as external torques of a simulation.

    The simulation computes these from the first wrench on: it is changed for that, see
    ``build_change``. All other methods are for the ticking thread.

    Args:
        simulator: The simulation.
        reference: Axes of wrenches, see ``ExternalWrenches``.

    Attributes:
        is_enabled: Whether the simulation has been changed.
    """

    def __init__(self, simulator: Simulator, reference: str) -> None:
        super().__init__(simulator.dynamics, reference)
        self._simulator = simulator
        self._acted_last_tick = self.is_enabled = False

    @property
    def need_torques(self) -> bool:
        """Whether torques must be set: wrenches act, or did so in the last tick."""
        return self._acted_last_tick or bool(self.active)

    def build_change(self, frame: str, wrench: ArrayLike) -> Change:
        """Build what the first wrench needs, which takes a second; returns the change.

        Raises:
            InvalidInput: As ``push``.
        """
        ExternalWrenches(self._simulator.model).push(frame, wrench, 0)
        return external_change(self._simulator)

    def enable(self) -> None:
        """Register that the simulation has been changed."""
        self.is_enabled = True

    def apply(self, note_last_torques: Callable[[], None]) -> None:
        """Set the torques of the next tick.

        ``note_last_torques`` is called while those of the last tick are set, since the energy
        account evaluates ticks with the torques that acted in them.
        """
        arm = self._simulator.arm
        tau = self.advance(arm.x[: arm.n], arm.step_count)
        note_last_torques()
        self._simulator.set_parameter(EXTERNAL, tau)
        self._acted_last_tick = bool(self.active)
