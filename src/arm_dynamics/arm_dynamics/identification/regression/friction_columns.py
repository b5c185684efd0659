# SPDX-License-Identifier: Apache-2.0
"""Friction of one joint as the engine computes it, as columns of a regression.

The laws are those of ``equations.friction`` and the tables those of ``equations.interpolation``,
which a scene's keys stand for; see ``model.friction``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations import friction
from arm_dynamics.equations.interpolation import Curve

VISCOUS, VISCOUS_SKEW = "viscous", "viscous_skew"
COULOMB, COULOMB_SKEW, EXCESS = "coulomb", "coulomb_skew", "excess"
LINEAR = (VISCOUS, COULOMB, COULOMB_SKEW, VISCOUS_SKEW, EXCESS)
"""Coefficients of which friction is a linear function. A constant torque, such as a sensor's
offset, is in a joint that moves the same as a skew of its Coulomb friction."""
STRIBECK_VELOCITY, LOAD = "stribeck_velocity", "load"
POINTS = 6
"""Of a table of friction by load."""


@dataclass(frozen=True)
class Shape:
    """What of a joint's friction its coefficients multiply.

    Attributes:
        stribeck_velocity: In [rad/s] or [m/s]; None where friction falls at once.
        load: Part of the dry friction that grows with the load, from none without load to all of
            it at the heaviest; None where it does not grow.
        heaviest: The heaviest load in [N m] or [N].
        points: Loads, the first of them 0, and how much of that part is there, from 0 to 1; none
            where it grows in proportion up to the heaviest.
    """

    stribeck_velocity: float | None = None
    load: float | None = None
    heaviest: float = 1.0
    points: tuple[tuple[float, float], ...] = ()

    @property
    def table(self) -> tuple[Array, Array]:
        """Loads, and the factor of dry friction at each."""
        at = np.linspace(0.0, self.heaviest, POINTS)
        part, share = at / self.heaviest, self.load or 0.0
        if self.points:
            at, part = np.array(self.points).T
        return at, 1.0 - share + share * part

    @property
    def steepness(self) -> float:
        """Most by which the factor grows from one point to the next, in [1/(N m)] or [1/N]."""
        at, factor = self.table
        return float((np.diff(factor) / np.diff(at)).max())

    def column(self, kind: str, v: Array, load: Array) -> Array:
        """Friction of a coefficient of one.

        Args:
            kind: One of ``LINEAR``.
            v: Velocities, shape (k,).
            load: Torques of the drive in [N m] or [N], shape (k,).
        """
        way = np.sign(v)
        if kind == VISCOUS:
            return np.asarray(friction.viscous(v, 1.0))
        if kind == VISCOUS_SKEW:
            return np.asarray(friction.viscous(v, 0.0, 1.0))
        fall = self.stribeck_velocity or 1.0
        level, excess = (0.0, 1.0) if kind == EXCESS else (1.0, 0.0)
        dry = friction.dry(v, way, level, excess, fall)
        if kind == COULOMB_SKEW:
            dry = way * dry
        return np.asarray(dry if self.load is None else dry * self._factor(load))

    def _factor(self, load: Array) -> Array:
        return np.asarray(Curve.through(*self.table)(abs(load)))


@dataclass(frozen=True)
class JointFit:
    """Friction of one joint: which coefficients it has, and the shape that they multiply.

    Attributes:
        kinds: Those of ``LINEAR`` that are estimated.
        shape: What they multiply.
        coefficients: Their values, by kind.
    """

    kinds: tuple[str, ...]
    shape: Shape = Shape()
    coefficients: dict[str, float] = field(default_factory=dict)

    def columns(self, v: Array, load: Array) -> Array:
        """One column for each kind, shape (k, kinds)."""
        made = [self.shape.column(kind, v, load) for kind in self.kinds]
        return np.column_stack(made) if made else np.zeros((len(v), 0))

    def torque(self, v: Array, load: Array) -> Array:
        """The friction, shape (k,)."""
        values = np.array([self.coefficients.get(kind, 0.0) for kind in self.kinds])
        return np.asarray(self.columns(v, load) @ values)
