# SPDX-License-Identifier: Apache-2.0
"""Friction as a static function of a joint's state: viscous, dry, and that of gears.

Friction models with internal states, such as LuGre, are in ``actuation``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property, reduce
from operator import mul
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import frozen
from arm_dynamics.equations import friction, transmission
from arm_dynamics.equations.elementary import Quantity, choose, larger, sign, size
from arm_dynamics.equations.interpolation import Curve
from arm_dynamics.equations.tree import like
from arm_dynamics.model.friction.table import FrictionTable

# Largest slope of friction over the torque that causes it, relative to the gear's efficiency; each
# iteration of ``SteadyFriction.overcome`` then halves the error.
STEEPEST = 0.5
# Static friction of an unloaded gear in [N m] or [N], which avoids a division by zero; an arm of
# 1e-9 kg and 1 mm weighs 1e-11 N m.
UNLOADED = 1e-24


class Sided(NamedTuple):
    """A coefficient of each joint that may differ by direction; arrays of shape (n,).

    Attributes:
        mean: Mean of the positive and the negative direction.
        skew: Half the difference of the two.
    """

    mean: Array
    skew: Array

    def times(self, factor: NDArray[Any]) -> Sided:
        """Both parts multiplied by factors of shape (n,)."""
        return Sided(read_only(self.mean * factor), read_only(self.skew * factor))


@frozen
class DryFriction:
    """Dry friction of joints; arrays of shape (n,) in model order, zero for joints without it.

    Methods take velocities v in [rad/s] or [m/s], the direction of sliding, -1 to 1, positions q
    in [rad] or [m], used only if ``by_position``, and torques of the drives in [N m] or [N], used
    only if ``by_load`` and by gears: arrays of shape (…, n) or expressions.

    Attributes:
        coulomb: Dry friction in sliding in [N m] or [N].
        static: Dry friction at rest in [N m] or [N].
        excess: Dry friction near zero speed less ``coulomb``; zero without a Stribeck curve.
        stribeck_velocity: Stribeck velocity in [rad/s] or [m/s]; 1 where there is none.
        position: Factor of dry friction by position, or None, for each joint.
        load: Factor of dry friction by the size of the drive's torque, or None, for each joint.
        scale: Factor of dry friction of each joint, see ``scaled``; None for 1.
    """

    coulomb: Sided
    static: Sided
    excess: Sided
    stribeck_velocity: Array
    position: tuple[Curve | None, ...]
    load: tuple[Curve | None, ...]
    scale: Quantity = field(default=None, kw_only=True)

    @property
    def by_position(self) -> bool:
        """Whether friction depends on the joints' positions."""
        return any(curve is not None for curve in self.position)

    @property
    def by_load(self) -> bool:
        """Whether friction depends on the drives' torques."""
        return any(curve is not None for curve in self.load)

    def of(self, joints: Sequence[int]) -> DryFriction:
        """Friction of the selected joints only; zero for the others."""
        indices = range(len(self.position))
        selected = np.isin(indices, joints)
        return DryFriction(
            coulomb=self.coulomb.times(selected),
            static=self.static.times(selected),
            excess=self.excess.times(selected),
            stribeck_velocity=self.stribeck_velocity,
            position=tuple(self.position[i] if selected[i] else None for i in indices),
            load=tuple(self.load[i] if selected[i] else None for i in indices),
            scale=self.scale,
        )

    def sliding(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Sliding friction of joints, of the sign of ``direction``."""
        numbers, (coulomb, excess) = like(v), (self.coulomb, self.excess)
        fall = numbers(self.stribeck_velocity)
        torque = friction.dry(v, direction, numbers(coulomb.mean), numbers(excess.mean), fall)
        if coulomb.skew.any() or excess.skew.any():
            skew = friction.dry(v, direction, numbers(coulomb.skew), numbers(excess.skew), fall)
            torque = torque + direction * skew
        factors = self._factors(q, load)
        return torque if factors is None else torque * factors

    def level_at(self, v: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Magnitude of ``sliding`` at v in [N m] or [N]; positive direction where v is zero."""
        sided = self.coulomb.skew.any() or self.excess.skew.any()
        direction = choose(v < 0.0, -1.0, 1.0) if sided else 1.0
        return direction * self.sliding(v, direction, q, load)

    def extremes(self, i: int) -> tuple[Array, Array]:
        """The lowest and the highest level of joint ``i`` over all speeds and factors.

        Returns:
            Levels in [N m] or [N], each for the positive and the negative direction, shape (2,).
        """
        factors = [curve.values for curve in (self.position[i], self.load[i]) if curve]
        least, most = (float(np.prod([f(v) for v in factors])) for f in (np.min, np.max))
        coulomb, static = (
            side.mean[i] + side.skew[i] * np.array([1.0, -1.0])
            for side in (self.coulomb, self.static)
        )
        return least * np.minimum(coulomb, static), most * np.maximum(coulomb, static)

    @property
    def steepest_rise(self) -> Array:
        """Largest slope of dry friction over speed in [N m s/rad] or [N s/m], shape (n,)."""
        return self._steepest(abs(self.excess.skew) - self.excess.mean)

    @property
    def steepest_fall(self) -> Array:
        """Largest slope by which it falls over speed, as by the Stribeck effect."""
        return self._steepest(abs(self.excess.skew) + self.excess.mean)

    def _steepest(self, change: Array) -> Array:
        """Slope √(2/e) ΔF/vs of a change by ΔF (1 - exp(-(v/vs)²)), zero if that is negative."""
        largest = [
            float(np.prod([curve.values.max() for curve in curves if curve]))
            for curves in zip(self.position, self.load, strict=True)
        ]
        slope = np.sqrt(2.0 / np.e) * np.maximum(change, 0.0) / self.stribeck_velocity
        return np.asarray(slope * largest)

    def _factors(self, q: Quantity, load: Quantity) -> Quantity | None:
        factors: list[Any] = [] if self.scale is None else [self.scale]
        if self.by_position:
            factors.append(_evaluate(self.position, q))
        if self.by_load:
            factors.append(_evaluate(self.load, size(load)))
        return reduce(mul, factors) if factors else None


@frozen
class JointFriction(DryFriction):
    """Friction of the joints of a scene; the dry part is that of joints with stick-slip.

    Attributes:
        viscous: Viscous friction in [N m s/rad] or [N s/m].
        tables: Friction by speed and position of each joint that has a table, else None; its dry
            part is among the others.
        by_law: Dry friction of the joints whose friction model has states, for that model.
        efficiency: Efficiency of each joint's gear, shape (n,).
        forward: Whether each drive's torque is positive, 1 or 0; None: as its sign says.
    """

    viscous: Sided
    tables: tuple[FrictionTable | None, ...]
    by_law: DryFriction
    efficiency: Array
    forward: Quantity = field(default=None, kw_only=True)

    @property
    def by_position(self) -> bool:
        """Whether friction depends on the joints' positions."""
        tables = any(table is not None and table.by_position for table in self.tables)
        return tables or super().by_position

    @property
    def rise(self) -> Array:
        """Bound of the slope over speed in [N m s/rad] or [N s/m], shape (n,)."""
        tables = [table.steepest_rise if table else 0.0 for table in self.tables]
        viscous = self.viscous.mean + abs(self.viscous.skew)
        return np.asarray(viscous + self.steepest_rise + np.maximum(tables, 0.0))

    @cached_property
    def has_dry(self) -> bool:
        """Whether any joint can stick."""
        return bool(self.level.any())

    @cached_property
    def level(self) -> Array:
        """Scale of ``relative_hold``: ``static``, or 1 where only a gear's loss holds."""
        only_gear = (self.static.mean == 0.0) & (self.efficiency < 1.0)
        return np.where(only_gear, 1.0, self.static.mean)

    @cached_property
    def gearless(self) -> JointFriction:
        """Copy without the gears' losses."""
        return replace(self, efficiency=np.ones_like(self.efficiency)) if self.gears else self

    @cached_property
    def gears(self) -> tuple[int, ...]:
        """Joints whose gear has losses."""
        return tuple(np.flatnonzero(self.efficiency < 1.0).tolist())

    def with_viscous(self, viscous: Array) -> JointFriction:
        """Copy with other mean viscous coefficients, shape (n,)."""
        return replace(self, viscous=self.viscous._replace(mean=read_only(viscous)))

    def scaled(self, coulomb: Quantity) -> JointFriction:
        """Copy with other mean levels in sliding, and those at rest in proportion."""
        nominal = self.coulomb.mean
        part = coulomb / like(coulomb)(np.where(nominal > 0.0, nominal, 1.0))
        return replace(self, scale=larger(part, UNLOADED))

    def smooth(self, v: Quantity, q: Quantity, coefficient: Quantity = None) -> Quantity:
        """Viscous friction, and that of tables but for their dry part.

        A coefficient, if given, replaces the scene's mean of viscous friction.
        """
        numbers, (mean, skew) = like(v), self.viscous
        mean = numbers(mean) if coefficient is None else coefficient
        torque = friction.viscous(v, mean, numbers(skew) if skew.any() else None)
        added = {
            i: _column(torque, i)
            + table.without_dry(_column(v, i), _column(q, i) if table.by_position else None)
            for i, table in enumerate(self.tables)
            if table is not None
        }
        return _with_columns(torque, added)

    def dry(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Sliding friction of the sign of ``direction``, without that of models with states."""
        torque = self.sliding(v, direction, q, load)
        geared = {i: _column(torque, i) + self._gear_loss(i, direction, load) for i in self.gears}
        return _with_columns(torque, geared)

    def _gear_loss(self, i: int, direction: Quantity, load: Quantity) -> Quantity:
        forward = None if self.forward is None else _column(self.forward, i)
        return transmission.gear_loss(
            _column(direction, i), _column(load, i), self.efficiency[i], forward
        )

    def relative_hold(self, reaction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Holding torque of a sticking joint, scaled such that it slips at ``level``."""
        scaled, (mean, skew) = reaction, self.static
        if skew.any():
            part = skew / np.where(mean > 0.0, mean, 1.0)
            scaled = reaction / (1.0 + like(reaction)(part) * sign(reaction))
        factors, geared = self._factors(q, load), {}
        for i in self.gears:
            push = _column(reaction, i)
            dry = mean[i] + skew[i] * sign(push)
            dry = dry if factors is None else dry * _column(factors, i)
            loss = self._gear_loss(i, sign(reaction), load)
            geared[i] = push * self.level[i] / (dry + size(loss) + UNLOADED)
        return _with_columns(scaled if factors is None else scaled / factors, geared)

    def most_held(self, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Size of the largest holding torque of each joint in a direction, -1 or 1."""
        return like(direction)(self.level) / size(self.relative_hold(direction, q, load))

    def gear_input(self, required: Quantity, direction: Quantity) -> Quantity:
        """Motor torques that deliver those ``required`` at the gears' outputs.

        A fraction of a direction takes that fraction of the loss.
        """
        motors = {}
        for i in self.gears:
            torque, sliding = _column(required, i), _column(direction, i)
            loss = transmission.gear_input(sliding, torque, self.efficiency[i]) - torque
            motors[i] = torque + size(sliding) * loss
        return _with_columns(required, motors)


def _column(x: Quantity, i: int) -> Quantity:
    return x[i] if isinstance(x, ca.SX) else np.asarray(x)[..., i]


def _with_columns(x: Quantity, columns: dict[int, Quantity]) -> Quantity:
    """``x`` with the entries of some joints replaced."""
    if not columns:
        return x
    result = ca.SX(x) if isinstance(x, ca.SX) else np.array(x, dtype=float)
    for i, column in columns.items():
        result[i if isinstance(x, ca.SX) else (..., i)] = column
    return result


def _evaluate(curves: Sequence[Curve | None], x: Quantity) -> Quantity:
    if isinstance(x, ca.SX):
        return ca.vertcat(*[1.0 if c is None else c(x[i]) for i, c in enumerate(curves)])
    x = np.asarray(x)
    ones = np.ones(x.shape[:-1])
    return np.stack([ones if c is None else c(x[..., i]) for i, c in enumerate(curves)], axis=-1)
