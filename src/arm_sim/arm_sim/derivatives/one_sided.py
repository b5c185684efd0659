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
# Largest difference of the two columns, and of the tick itself from what they predict, relative.
SAME, ROUNDING = 1e-3, 1e-11


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

    def moved(self, entry: int, distance: float, tuned: Sequence[int]) -> TickPoint:
        """The point moved in one entry of (x, r, p[tuned])."""
        nx, held = len(self.x), len(self.x) + len(self.r)
        numbers = np.concatenate([self.x, self.r, self.p])
        at = entry if entry < held else held + tuned[entry - held]
        numbers[at] += distance * max(1.0, abs(numbers[at]))
        return TickPoint(*np.split(numbers, (nx, held)))


# State at the end of a tick, shape (nx,), or its derivatives by (x, r, p[tuned])
Tick = Callable[[TickPoint], Array]


def one_sided(
    after: Tick, slope: Tick, point: TickPoint, side: int, tuned: Sequence[int],
    names: Sequence[str],
) -> Array:  # fmt: skip
    """One-sided derivatives of a tick.

    Args:
        after: The tick.
        slope: Its derivatives; between two modes, those of either.
        point: Where.
        side: 1 or -1.
        tuned: Entries of p to differentiate by.
        names: Of the entries of (x, r, p[tuned]), for messages.

    Returns:
        Derivatives, shape (nx, nx + n + nt).

    Raises:
        NotDifferentiable: If a one-sided derivative does not exist.
        SimulationDiverged: If the tick cannot be computed.
    """
    begin, columns = after(point), list[Array]()
    for entry, name in enumerate(names):
        near, far = (point.moved(entry, side * k * DISTANCE, tuned) for k in (1, 2))
        at_near, at_far = (slope(beside)[:, entry] for beside in (near, far))
        column = 2.0 * at_near - at_far  # extrapolated to the point
        # Of one entry, as rounded: all others are the same.
        step = (near.x - point.x).sum() + (near.r - point.r).sum() + (near.p - point.p).sum()
        scale, rounding = 1.0 + abs(at_near).max(), ROUNDING * (1.0 + abs(begin).max())
        bends = abs(at_near - at_far).max() > SAME * scale
        missed = after(near) - begin - 0.5 * step * (column + at_near)
        jumps = abs(missed).max() > SAME * abs(step) * scale + rounding
        if bends or jumps:
            raise NotDifferentiable(
                f"linearize: no derivative by {name} on the side {side:+d}: the state after the "
                "time step jumps, or changes ever faster"
            )
        columns.append(column)
    return np.column_stack(columns)
