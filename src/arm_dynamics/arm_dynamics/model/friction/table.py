# SPDX-License-Identifier: Apache-2.0
"""Friction of a joint from a table by its speed and position.

With T_k(v) the size of friction at position k of the table, and w_k(q) smooth steps that are 1 at
position k, 0 at the others, and 1 in sum,

    F(q, v) = Σ w_k(q) (s T_k(0) + C_k(v)),    C_k(v) = sign(v) (T_k(v) - T_k(0))

with the direction s of sliding. The first part is dry friction; C_k is continuous with its slope,
zero at rest. Since T_k is monotone between its points and nowhere negative, F v ≥ 0 everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.elementary import Quantity
from arm_dynamics.equations.interpolation import Curve, chords


@dataclass(frozen=True)
class FrictionTable:
    """Friction of one joint by speed and position.

    Attributes:
        dry: Largest dry friction over all positions in [N m] or [N].
        dry_by_position: Factor of ``dry`` by position; None if there is one row, or ``dry`` is 0.
        moving: C_k, torque in [N m] or [N] by speed, of each row.
        shares: w_k by position, of each row; none if there is one row.
    """

    dry: float
    dry_by_position: Curve | None
    moving: tuple[Curve, ...]
    shares: tuple[Curve, ...]

    @staticmethod
    def of(speed: Array, torque: Array, position: Array | None, period: float) -> FrictionTable:
        """The table through points.

        Args:
            speed: In [rad/s] or [m/s], increasing, 0 among them, shape (k,).
            torque: Sizes of friction in [N m] or [N], shape (rows, k).
            position: Positions of the rows in [rad] or [m], shape (rows,); None for one row.
            period: Period of the positions; 0 if they do not repeat.
        """
        still = torque[:, speed == 0.0][:, 0]
        moving = tuple(_course(speed, row - rest) for row, rest in zip(torque, still, strict=True))
        dry = float(still.max())
        if position is None:
            return FrictionTable(dry, None, moving, ())
        steps = tuple(_steps(position, row, period) for row in np.eye(len(position)))
        return FrictionTable(
            dry, _steps(position, still / dry, period) if dry else None, moving, steps
        )

    @property
    def by_position(self) -> bool:
        """Whether it depends on the position."""
        return bool(self.shares)

    @property
    def steepest_rise(self) -> float:
        """Largest slope over speed in [N m s/rad] or [N s/m]."""
        return max(steepest(row) for row in self.moving)

    def without_dry(self, v: Quantity, q: Quantity) -> Quantity:
        """Σ w_k(q) C_k(v) in [N m] or [N].

        Args:
            v: Velocity in [rad/s] or [m/s], a number, array or expression.
            q: Position in [rad] or [m], likewise; used only if ``by_position``.
        """
        if not self.by_position:
            return self.moving[0](v)
        pairs = zip(self.shares, self.moving, strict=True)
        return sum((share(q) * row(v) for share, row in pairs), 0.0 * v)


def steepest(curve: Curve) -> float:
    """The largest slope of a curve, between a thousand points."""
    grid = np.linspace(curve.at[0], curve.at[-1], 1000)
    return float(np.max(chords(grid, curve(grid))))


def _course(speed: Array, torque: Array) -> Curve:
    """The torque besides dry friction; speeds that begin at 0 hold for both directions."""
    if speed[0] == 0.0:
        speed = np.concatenate([-speed[:0:-1], speed])
        torque = np.concatenate([torque[:0:-1], torque])
    torque = np.sign(speed) * torque
    rises = np.maximum(chords(speed, torque)[[0, -1]], 0.0)  # level where it falls: F v ≥ 0
    return Curve.through(speed, torque, ends=(rises[0], rises[1]))


def _steps(at: Array, values: Array, period: float) -> Curve:
    """Smooth steps between values, of zero slope at each."""
    curve = Curve.through(at, values, period)
    return replace(curve, slopes=np.zeros_like(curve.slopes))
