# SPDX-License-Identifier: Apache-2.0
"""Torques of drives, which joint states report if they differ from the commands."""

from ctypes import addressof, c_void_p

import casadi as ca

from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.simulation.simulated_arm import SimulatedArm


class DriveTorques:
    """Torques of a simulation's drives at the end of the last tick; see ``Simulator.effort``.

    Attributes:
        values: In [N m] or [N], shape (n,).
        entry_address: Address of the ``kernel.Entry`` by which C updates them, or None.
    """

    @one_at_a_time
    def __init__(self, arm: SimulatedArm, torques: ca.Function) -> None:
        """Compile ``arm.plant.torques``, which scenes with internal states have."""
        self._arm = arm
        self._call = Kernel([torques], arm.compiled.backend).call(torques.name())
        self.values, entry = self._call.outputs[0], self._call.entry
        self.entry_address = None
        if entry is not None:
            # Between ticks, C calls the entry by itself. The arm changes its arrays in place and
            # never replaces them, so their addresses stay valid.
            inputs = (c_void_p * 2).from_address(entry.arguments)
            inputs[:] = arm.x.ctypes.data, arm.acted.ctypes.data
            self.entry_address = addressof(entry)

    def update(self) -> None:
        """Evaluate them without compiled code."""
        self._call(self._arm.x, self._arm.acted)
