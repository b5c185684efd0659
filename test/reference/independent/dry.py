# SPDX-License-Identifier: Apache-2.0
"""Friction that holds: Coulomb, static, Stribeck, by position, and that of lossy gears."""

from collections.abc import Mapping
from math import exp
from typing import Any

import numpy as np

from .description import only

Array = np.ndarray
KNOWN = ("viscous", "coulomb", "static", "stribeck_velocity", "position", "lugre")


class Dry:
    """Dry friction of one joint.

    The gear's loss is on the side of the load: of the drive's torque τ arrives η τ where it
    drives, τ/η where it is driven, so friction in the direction of motion takes (1 - η) |τ| or
    (1/η - 1) |τ|.
    """

    def __init__(self, joint: int, friction: Mapping[str, Any], efficiency: float) -> None:
        only(friction, "friction", *KNOWN)
        self.joint, self.efficiency = joint, efficiency
        bristles = "lugre" in friction
        self.Fc = 0.0 if bristles else friction.get("coulomb", 0.0)
        self.Fs = 0.0 if bristles else friction.get("static", self.Fc)
        self.vs = friction.get("stribeck_velocity")
        self._table = table(friction["position"]) if "position" in friction else None
        self.geared = efficiency < 1.0

    @property
    def exists(self) -> bool:
        """Whether it can hold anything."""
        return self.Fs > 0.0 or self.geared

    def _gear(self, way: int, load: float, sign: float) -> float:
        part = 1.0 - self.efficiency if way * sign > 0 else 1.0 / self.efficiency - 1.0
        return sign * load * part

    def sliding(self, way: int, q: float, v: float, load: float, sign: float) -> float:
        """Size of the friction against sliding the way of ``way``; ``sign`` of the load."""
        fall = exp(-((v / self.vs) ** 2)) if self.vs else 0.0
        return self._factor(q) * (self.Fc + (self.Fs - self.Fc) * fall) + self._gear(
            way, load, sign
        )

    def level(self, way: int, q: float, load: float, sign: float) -> float:
        """Most that it holds of a push the way of ``way``."""
        return self._factor(q) * self.Fs + self._gear(way, load, sign)

    def _factor(self, q: float) -> float:
        return self._table(q) if self._table else 1.0


def table(said: Mapping[str, Any]) -> Any:
    """The monotone curve of Fritsch and Butland through the points, level at its ends.

    SciPy's own, ``PchipInterpolator``, has the same slopes inside and others at the ends.
    """
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

    only(said, "position", "at", "factor")
    at, factor = np.array(said["at"], dtype=float), np.array(said["factor"], dtype=float)
    slopes = PchipInterpolator(at, factor).derivative()(at) if len(at) > 2 else np.zeros(2)
    slopes[[0, -1]] = 0.0
    curve = CubicHermiteSpline(at, factor, slopes)
    return lambda q: float(curve(min(max(q, at[0]), at[-1])))
