# SPDX-License-Identifier: Apache-2.0
"""The simplest laws with states, to test how the simulator treats any of them."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics.actuation import Flow, InternalState, StateKind
from arm_dynamics.arrays import Array


@dataclass(frozen=True)
class Motor:
    """A coil on each chosen joint, driven by a voltage: L i' = V - R i - K v, torque K i."""

    joints: tuple[bool, ...]  # which joints have one, shape (n,)
    R: float = 2.0  # resistance in [ohm]
    L: float = 0.01  # inductance in [H]; 0 for a motor without a state
    K: float = 0.5  # torque constant in [N m/A]
    title: str = "toy motor"

    @property
    def states(self) -> tuple[InternalState, ...]:
        """A current for each motor, if it has inductance; errors in amperes."""
        names = {i: f"joint{i} current [A]" for i in self._which if self.L}
        return tuple(InternalState(i, StateKind.CURRENT, name, 1.0) for i, name in names.items())

    @property
    def replaces_command(self) -> np.ndarray:
        """Joints with a motor."""
        return np.array(self.joints)

    @property
    def _which(self) -> list[int]:
        return [i for i, has in enumerate(self.joints) if has]

    def initial(self, q: Array, v: Array) -> Array:
        """No current."""
        return np.zeros(len(self.states))

    def _current(self, v: ca.SX, z: ca.SX, u: ca.SX) -> ca.SX:
        if self.L:
            return z
        return ca.vertcat(*[(u[i] - self.K * v[i]) / self.R for i in self._which])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """Kirchhoff and Lorentz, magnetic energy and the heat in the resistance."""
        current = self._current(v, z, u)
        torque = ca.SX(len(self.joints), 1)
        slopes = []
        for k, i in enumerate(self._which):
            torque[i] = self.K * current[k]
            if self.L:
                slopes.append((u[i] - self.R * z[k] - self.K * v[i]) / self.L)
        return Flow(
            torque,
            ca.vertcat(ca.SX(0, 1), *slopes),
            stored=0.5 * self.L * ca.sumsqr(z) if self.L else 0.0,
            supplied=sum((u[i] * current[k] for k, i in enumerate(self._which)), ca.SX(0.0)),
            lost=self.R * ca.sumsqr(current),
        )
