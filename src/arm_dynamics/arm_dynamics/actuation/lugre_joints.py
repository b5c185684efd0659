# SPDX-License-Identifier: Apache-2.0
"""LuGre friction of the joints that ask for it: the states z are the deflections of bristles."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.internal_state import Flow
from arm_dynamics.arrays import Array
from arm_dynamics.equations import lugre
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.friction import Bristles


class LugreFriction:
    """All joints with bristles as one law; see ``stateful.StatefulLaw``.

    Viscous friction, σ2 v, is not part of it: it acts on every joint alike.
    """

    title = "LuGre friction"

    def __init__(self, model: ArmModel, bristles: Bristles) -> None:
        """Take the joints and their coefficients."""
        self._n, self._b = model.n, bristles
        self._names = [model.joint_names[i] for i in bristles.joints]
        self._units = [
            "m" if model.joint_types[i] == "prismatic" else "rad" for i in bristles.joints
        ]
        fading = np.isfinite(bristles.fading)
        self._fading = np.where(fading, bristles.fading, 1.0) if fading.any() else None
        self._fades = fading

    @property
    def names(self) -> tuple[str, ...]:
        """A deflection for each joint."""
        named = zip(self._names, self._units, strict=True)
        return tuple(f"{name} bristle deflection [{unit}]" for name, unit in named)

    @property
    def scale(self) -> Array:
        """Deflection at which bristles give way, Fs/σ0."""
        return self._b.static / self._b.sigma0

    @property
    def replaces_command(self) -> NDArray[np.bool_]:
        """No joint's command."""
        return np.zeros(self._n, dtype=bool)

    def initial(self, q: Array, v: Array) -> Array:
        """Straight bristles."""
        return np.zeros(len(self._names))

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """See ``laws.lugre``."""
        w = self._speeds(v)
        rate = lugre.bending(w, z, self._b.sigma0, self._level(w))
        held = lugre.torque(z, rate, self._b.sigma0, self._damping(w))
        torque = ca.SX(self._n, 1)
        for k, i in enumerate(self._b.joints):
            torque[i] = -held[k]
        return Flow(torque, rate)

    def stored(self, q: ca.SX, v: ca.SX, z: ca.SX) -> ca.SX:
        """In bent bristles."""
        return 0.5 * ca.dot(ca.DM(self._b.sigma0), z**2)

    def supplied(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> ca.SX:
        """Nothing."""
        return ca.SX(0.0)

    def lost(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> ca.SX:
        """See ``laws.lugre``."""
        w = self._speeds(v)
        level = self._level(w)
        rate = lugre.bending(w, z, self._b.sigma0, level)
        return ca.sum1(lugre.heat(w, z, rate, self._b.sigma0, self._damping(w), level))

    def _speeds(self, v: ca.SX) -> ca.SX:
        return ca.vertcat(*[v[i] for i in self._b.joints])

    def _level(self, w: ca.SX) -> ca.SX:
        b = self._b
        return lugre.level(w, b.coulomb, b.static - b.coulomb, b.stribeck_velocity)

    def _damping(self, w: ca.SX) -> ca.SX:
        if self._fading is None:
            return ca.SX(ca.DM(self._b.sigma1))
        faded = lugre.faded(w, self._b.sigma1, self._fading)
        kept = [faded[k] if fades else self._b.sigma1[k] for k, fades in enumerate(self._fades)]
        return ca.vertcat(*kept)
