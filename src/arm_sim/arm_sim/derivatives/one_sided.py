# SPDX-License-Identifier: Apache-2.0
"""One-sided derivatives of a tick at a point where it has no derivative.

Column j is the limit of (F(x + s h e_j) - F(x)) / (s h) for h → 0+, s = ±1, of the tick F and one
entry of what it is differentiated by. Beside the point, the tick has a derivative whose column j
converges to that. Where a change of entry j alone stays on the boundary between two modes, the
derivatives of both modes agree along it, since the tick is continuous there: either will do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.exceptions import NotDifferentiable

# Distance of the nearer of two places beside the point, relative to the larger of a number
# and 1; twice as far is the other, and the column is extrapolated from both.
DISTANCE = 1e-6
# Largest difference of the two columns, and of the tick from what they predict, relative.
COLUMN_TOLERANCE = 1e-3
# Rounding of the tick, relative
ROUNDING = 1e-11


@dataclass(frozen=True)
class TickPoint:
    """Where a tick is differentiated.

    Attributes:
        x: State at its beginning, shape (nx,).
        r: Command, shape (n,).
        p: Tunable quantities, shape (np,).
    """

    x: Array
    r: Array
    p: Array

    def neighbour(self, entry: int, distance: float, p_indices: Sequence[int]) -> TickPoint:
        """Another point, at a distance in one entry of (x, r, p[p_indices])."""
        nx, p_start = len(self.x), len(self.x) + len(self.r)
        numbers = np.concatenate([self.x, self.r, self.p])
        place = entry if entry < p_start else p_start + p_indices[entry - p_start]
        numbers[place] += distance * max(1.0, abs(numbers[place]))
        return TickPoint(*np.split(numbers, (nx, p_start)))


# State at the end of a tick, shape (nx,), or its derivatives by (x, r, p[p_indices])
Tick = Callable[[TickPoint], Array]


def one_sided(
    after: Tick, slope: Tick, point: TickPoint, side: int, p_indices: Sequence[int],
    names: Sequence[str],
) -> Array:  # fmt: skip
    """One-sided derivatives of a tick.

    Args:
        after: The tick.
        slope: Derivatives of the tick; between two modes, those of either.
        point: Where the tick is differentiated.
        side: 1 or -1.
        p_indices: Indices in p of the quantities to differentiate by.
        names: Names of the entries of (x, r, p[p_indices]), for messages.

    Returns:
        Derivatives, shape (nx, nx + n + nt).

    Raises:
        NotDifferentiable: If a one-sided derivative does not exist.
        SimulationDiverged: If the tick cannot be computed.
    """
    end, columns = after(point), list[Array]()
    for entry, name in enumerate(names):
        near, far = (point.neighbour(entry, side * k * DISTANCE, p_indices) for k in (1, 2))
        near_column, far_column = (slope(neighbour)[:, entry] for neighbour in (near, far))
        column = 2.0 * near_column - far_column  # extrapolated to the point
        # The rounded distance of the only entry that differs
        step = (near.x - point.x).sum() + (near.r - point.r).sum() + (near.p - point.p).sum()
        scale, rounding = 1.0 + abs(near_column).max(), ROUNDING * (1.0 + abs(end).max())
        is_bent = abs(near_column - far_column).max() > COLUMN_TOLERANCE * scale
        deviation = after(near) - end - 0.5 * step * (column + near_column)
        has_jump = abs(deviation).max() > COLUMN_TOLERANCE * abs(step) * scale + rounding
        if is_bent or has_jump:
            raise NotDifferentiable(
                f"linearize: no derivative by {name} on the side {side:+d}: the state after the "
                "time step jumps, or changes ever faster"
            )
        columns.append(column)
    return np.column_stack(columns)
