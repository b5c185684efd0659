# SPDX-License-Identifier: Apache-2.0
"""LuGre friction (docs/concepts/friction.md, LuGre)."""

from collections.abc import Mapping
from math import exp
from typing import Any

import numpy as np

from .description import only
from .flow import Flow, Law

Array = np.ndarray


class Bristles(Law):
    """z' = v - σ0 |v| z / g(v), F = σ0 z + σ1 z'; the rest of the friction acts elsewhere."""

    size = 1

    def __init__(self, joint: int, friction: Mapping[str, Any]) -> None:
        only(friction["lugre"], "lugre", "sigma0", "sigma1", "sigma1_velocity")
        self.joint = joint
        self.s0 = friction["lugre"]["sigma0"]
        self.s1 = friction["lugre"].get("sigma1", 0.0)
        self.fading = friction["lugre"].get("sigma1_velocity")
        self.Fc = friction["coulomb"]
        self.Fs = friction.get("static", self.Fc)
        self.vs = friction.get("stribeck_velocity", 1.0)

    def kinks(self, q: float, v: float, z: Array) -> tuple[float, ...]:
        return (v,)

    def flow(self, q: float, v: float, z: Array, u: float, signs: Array) -> Flow:
        g = self.Fc + (self.Fs - self.Fc) * exp(-((v / self.vs) ** 2))
        s1 = self.s1 * exp(-((v / self.fading) ** 2)) if self.fading else self.s1
        dz = v - self.s0 * signs[0] * v * z[0] / g
        F = self.s0 * z[0] + s1 * dz
        stored = 0.5 * self.s0 * z[0] ** 2
        return Flow(-F, (dz,), stored, lost=F * v - self.s0 * z[0] * dz)
