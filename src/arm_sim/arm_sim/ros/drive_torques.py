# SPDX-License-Identifier: Apache-2.0
"""Torques of drives on the joints, which joint states report as efforts."""

from __future__ import annotations

from ctypes import addressof

from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.simulation.simulated_arm import SimulatedArm


class DriveTorques:
    """Torques of a simulation's drives at the end of the last tick; see ``Simulator.effort``.

    Attributes:
        values: In [N m] or [N], updated by ``update``, shape (n,).
        place: Address of the compiled function as a ``kernel.Entry``; None without one.
    """

    @one_at_a_time
    def __init__(self, arm: SimulatedArm) -> None:
        """Compile them; for a scene with models with internal states."""
        torques = arm.plant.torques
        assert torques is not None
        self._arm = arm
        self._call = Kernel([torques], arm.compiled.backend).call(torques.name())
        self.values, entry = self._call.outputs[0], self._call.entry
        self.place = None if entry is None else addressof(entry)

    def update(self) -> None:
        """Evaluate them."""
        self._call(self._arm.x, self._arm.acted)
