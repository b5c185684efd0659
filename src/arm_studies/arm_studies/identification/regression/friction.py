# SPDX-License-Identifier: Apache-2.0
"""Friction of one joint, as the simulator computes it, as columns of a regression.

The laws are those of ``equations.friction`` and the tables those of ``equations.interpolation``;
see ``model.friction`` for the keys of a scene.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations import friction
from arm_dynamics.equations.interpolation import Curve

VISCOUS, VISCOUS_SKEW = "viscous", "viscous_skew"
COULOMB, COULOMB_SKEW, EXCESS = "coulomb", "coulomb_skew", "excess"
# Coefficients in which friction is linear. In a moving joint, a constant torque, such as a sensor
# offset, is equivalent to a skew of its Coulomb friction.
LINEAR = (VISCOUS, COULOMB, COULOMB_SKEW, VISCOUS_SKEW, EXCESS)
DRY = (COULOMB, COULOMB_SKEW, EXCESS)  # Those that grow with the load.
LOAD = "load"  # a coefficient that grows with the load, while laws are selected
# Largest fraction of the dry friction that may grow with the load, or with the speed: friction is
# positive.
LARGEST_SHARE = 0.98
LARGEST_STEP = 0.7  # Largest change of a shape's parameter, or of its logarithm, at a time.
# Largest growth of friction with the load; the scene's curve is up to half as steep again.
LARGEST_GROWTH = 0.3
POINTS = 6  # Number of points in a table of friction over load.


class ShapeParameter(NamedTuple):
    """A parameter of a ``Shape``; ``at`` and ``part`` are coordinates of one of its points."""

    kind: Literal["stribeck_velocity", "load", "at", "part"]
    point: int = 0


@dataclass(frozen=True)
class Shape:
    """The nonlinear parameters of a joint's friction, which its coefficients multiply.

    Attributes:
        stribeck_velocity: In [rad/s] or [m/s]; None if friction does not fall with velocity.
        load: Fraction of the dry friction that grows with the load, from zero without load to all
            of it at the largest; None if it does not grow.
        heaviest: The largest load in [N m] or [N].
        points: Loads, the first of them 0, and the growth at each, from 0 to 1; empty if it is
            proportional up to the largest load.
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

    def growth(self, load: Array) -> Array:
        """The factor of dry friction under torques of the drive in [N m] or [N], shape (k,)."""
        return np.asarray(Curve.through(*self.table)(abs(load)))

    def moved(self, parameter: ShapeParameter, by: float) -> Shape:
        """A copy with one parameter changed: velocities, and gaps between loads, relatively."""
        kind, i = parameter
        if kind == "load":
            return replace(self, load=float(np.clip((self.load or 0.0) + by, 0.0, LARGEST_SHARE)))
        factor = float(np.exp(np.clip(by, -LARGEST_STEP, LARGEST_STEP)))
        if kind == "stribeck_velocity":
            return replace(self, stribeck_velocity=(self.stribeck_velocity or 1.0) * factor)
        at, part = np.array(self.points).T
        if kind == "at":
            at[i:] += (at[i] - at[i - 1]) * (factor - 1.0)
        else:
            part[i] = np.clip(part[i] + by, part[i - 1], part[i + 1])
        return replace(self, points=tuple(zip(at.tolist(), part.tolist(), strict=True)))

    def unloaded(self, kind: str, v: Array) -> Array:
        """Friction of a kind of ``LINEAR`` with a unit coefficient, without growth, shape (k,)."""
        direction = np.sign(v)
        if kind == VISCOUS:
            return np.asarray(friction.viscous(v, 1.0))
        if kind == VISCOUS_SKEW:
            return np.asarray(friction.viscous(v, 0.0, 1.0))
        fall = self.stribeck_velocity or 1.0
        level, excess = (0.0, 1.0) if kind == EXCESS else (1.0, 0.0)
        dry = friction.dry(v, direction, level, excess, fall)
        return np.asarray(direction * dry if kind == COULOMB_SKEW else dry)


@dataclass(frozen=True)
class JointFit:
    """Friction of one joint: its coefficients, and the shape that they multiply.

    Attributes:
        kinds: Coefficients of ``LINEAR`` that are estimated.
        shape: Its nonlinear parameters.
        coefficients: Values by kind.
        steepness: Growth with the load that was left out because it is too steep, relative to the
            load; 0 if none was.
    """

    kinds: tuple[str, ...]
    shape: Shape = Shape()
    coefficients: dict[str, float] = field(default_factory=dict)
    steepness: float = 0.0

    @property
    def nonlinear(self) -> list[ShapeParameter]:
        """The parameters of its shape that its kinds have."""
        parameters, count = list[ShapeParameter](), len(self.shape.points)
        if self.shape.load is not None:
            parameters.append(ShapeParameter("load"))
            parameters += [ShapeParameter("at", i) for i in range(1, count)]
            parameters += [ShapeParameter("part", i) for i in range(1, count - 1)]
        if EXCESS in self.kinds and self.shape.stribeck_velocity is not None:
            parameters.append(ShapeParameter("stribeck_velocity"))
        return parameters

    def torque(self, v: Array, load: Array) -> Array:
        """The friction, shape (k,)."""
        growth, total = self.shape.growth(load), np.zeros_like(v)
        for kind in self.kinds:
            factor = growth if kind in DRY else 1.0
            total += self.coefficients.get(kind, 0.0) * factor * self.shape.unloaded(kind, v)
        return total


SIMPLE_LAW = JointFit((VISCOUS, COULOMB, COULOMB_SKEW))  # of joints whose law is not selected yet
