# SPDX-License-Identifier: Apache-2.0
"""Modes of joints and contacts at a state, and the reactions that they transmit."""

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import pointer
from arm_dynamics.codegen.kernel import Kernel
from arm_sim.plant.plant import Plant
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.events import Modes


class Reactions:
    """Reactions at a state x, shape (nx,), under torques u, shape (n,), and quantities p, (np,).

    Args:
        plant: The equation of motion.
        kernel: Its compiled functions.
        compiled: Their code with the engine; None on the virtual machine, which has no events.
    """

    def __init__(self, plant: Plant, kernel: Kernel, compiled: Compiled | None) -> None:
        self._plant, self._kernel, self._compiled = plant, kernel, compiled

    def modes_at(self, x: Array, u: Array, p: Array) -> Modes:
        """Modes of joints and contacts at a state under a torque.

        A contact that approaches its plane is treated as closed already.
        """
        modes = Modes(self._plant, p)
        modes.direction[:] = 1.0
        set_switches(modes, self._kernel, x, u)
        if self._plant.eventful and self._compiled:
            arrays = np.ascontiguousarray(x), np.ascontiguousarray(u), modes.p
            self._compiled.engine.find_modes(self._compiled.scene, *map(pointer, arrays))
        return modes

    def load_sharing(self, x: Array, u: Array, modes: Modes) -> tuple[Array, Array]:
        """How parts that hold together share their load, where least norms are beyond a limit.

        Returns:
            Change of the unknown contact forces from those of least norm to the nearest within
            all limits, shape (3 nc,), and of the holding torques of joints, shape (n,).
        """
        contacts, n = 3 * len(self._plant.points), self._plant.model.n
        change = np.zeros(contacts + n)
        if self._compiled and self._plant.eventful:
            arrays = np.ascontiguousarray(x), np.ascontiguousarray(u), modes.p, change
            self._compiled.engine.share_reactions(self._compiled.scene, *map(pointer, arrays))
        return change[:contacts], change[contacts:]

    def of_stops(self, x: Array, u: Array, p: Array) -> Array:
        """Torques with which stops hold joints back at a state under a torque, shape (n,)."""
        q, (lower, upper) = x[: self._plant.model.n], self._plant.model.stops.place
        if not (self._kernel.native and ((q <= lower) | (q >= upper)).any()):
            return np.zeros(len(q))
        modes = self.modes_at(x, u, p)
        *_, torque, _ = self._kernel.call("loads")(x, u, modes.p)
        torque = torque - self.load_sharing(x, u, modes)[1]
        pushes = np.where(q <= lower, torque > 0.0, (q >= upper) & (torque < 0.0))
        return np.where(pushes, torque, 0.0)

    def beside_bilateral(self, x: Array, u: Array, p: Array) -> Array:
        """Torques of contacts and friction at rest, beside bilateral constraints, shape (n,)."""
        modes = self.modes_at(x, u, p)
        _, torque = self._kernel.call("bilateral")(x, u, modes.p)
        forces, joints = self.load_sharing(x, u, modes)
        if not (forces.any() or joints.any()):
            return torque
        push, *_ = self._kernel.call("statics")(x, u, modes.p)
        spread = push.reshape(-1, len(joints)).T
        return torque + spread[:, spread.shape[1] - len(forces) :] @ forces - joints


def set_switches(modes: Modes, kernel: Kernel, x: Array, u: Array) -> None:
    """Set the modes of cords and drives to those at a state under a command."""
    if modes.switches.size:
        modes.switches[:] = kernel.call("switches")(x, u, modes.p)[0] >= 0.0
