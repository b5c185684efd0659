# SPDX-License-Identifier: Apache-2.0
"""The drives of an arm: motors, gears and transmissions between the commands and the links."""

from __future__ import annotations

from collections.abc import Iterable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.drive_equations import Instant, at_rest, instant, state_names
from arm_dynamics.actuation.internal_state import Flow
from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel


class Drives:
    """What turns commands into torques, for all joints of a scene that have an actuator.

    Its states are, joint by joint and as far as the scene asks for them: the motor's current where
    a voltage acts through an inductance; the motor's position and velocity as seen at the joint,
    and the state of the hysteresis, where the transmission is flexible.

    Attributes:
        title: What it is, for people.
        names: Its states, for people.
        scale: Size of each state that matters for its error.
        replaces_command: Joints that have a drive, shape (n,).
    """

    title = "motors and transmissions"

    def __init__(self, model: ArmModel) -> None:
        self._n = model.n
        self._joints = [(i, drive) for i, drive in enumerate(model.drives) if drive is not None]
        states = [state_names(d, model.joint_types[i] != "prismatic") for i, d in self._joints]
        self.names = tuple(
            f"{model.joint_names[i]} {name}"
            for (i, _), named in zip(self._joints, states, strict=True)
            for name in named
        )
        self.scale: Array = np.array([size for named in states for size in named.values()])
        self.replaces_command: NDArray[np.bool_] = np.array([bool(d) for d in model.drives])
        self._ends = np.cumsum([0, *map(len, states)]).tolist()

    def initial(self, q: Array, v: Array) -> Array:
        """States when the arm is put to q, v: no current, nothing twisted; shape (nz,)."""
        states = [at_rest(drive, float(q[i]), float(v[i])) for i, drive in self._joints]
        return np.array([number for state in states for number in state], dtype=float)

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Torques on the links and rates of the states under commands u, shape (n,)."""
        torque, slopes = ca.SX(self._n, 1), ca.SX(0, 1)
        for (i, _), now in zip(self._joints, self._instants(q, v, z, u), strict=True):
            torque[i] = now.torque
            slopes = ca.vertcat(slopes, *now.slopes)
        return Flow(torque, slopes)

    def stored(self, q: ca.SX, v: ca.SX, z: ca.SX) -> ca.SX:
        """Magnetic and elastic energy, and kinetic energy of rotors on flexible drives, in [J]."""
        return _sum(now.stored for now in self._instants(q, v, z, ca.SX(self._n, 1)))

    def supplied(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> ca.SX:
        """Voltage times current in [W]; mechanical power of a motor without torque constant."""
        return _sum(now.supplied for now in self._instants(q, v, z, u))

    def lost(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> ca.SX:
        """Heat of windings, of transmissions, and of rotors on flexible drives, in [W]."""
        return _sum(now.lost for now in self._instants(q, v, z, u))

    def _instants(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> list[Instant]:
        parts = zip(self._joints, self._ends, self._ends[1:], strict=False)
        return [
            instant(drive, q[i], v[i], [z[k] for k in range(a, b)], u[i])
            for (i, drive), a, b in parts
        ]


def _sum(terms: Iterable[ca.SX]) -> ca.SX:
    return sum(terms, ca.SX(0.0))
