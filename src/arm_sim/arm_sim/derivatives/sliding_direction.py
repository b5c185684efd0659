# SPDX-License-Identifier: Apache-2.0
"""Rate at which friction turns the direction of sliding contacts.

The engine limits the length of parts of a tick by it (``find_reach`` in ``native/segments.h``), so
their length depends on the state.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.contact import Mode
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import jacobian_by
from arm_sim.stepping.events import Modes

# Mobility across the direction of sliding, relative to the whole, that is rounding.
NO_TURN = 1e-12
# Largest relative deviation of the length of a part from that of the rate.
SAME = 1e-6


def starts_to_slide(plant: Plant, p: ca.SX) -> ca.SX:
    """Whether a contact starts to slide under the modes in p, 1 or 0: it keeps its direction."""
    mode, starts = Mode.of(plant.parts(p)[-1]), ca.SX(0)
    for k, point in enumerate(plant.points):
        if point.friction > 0.0:
            starts = ca.logic_or(starts, mode.closed[k] * (1 - mode.sticks[k]) * mode.fixed[k])
    return starts


class SlidingDirection:
    """SlidingDirection of the contacts of a scene.

    Args:
        plant: The scene's equations; it has contacts.
        tuned: Places in p of the quantities to differentiate by.
    """

    def __init__(self, plant: Plant, tuned: Sequence[int] = ()) -> None:
        self._plant = plant
        functions = {event.name(): event for event in plant.events}
        x, u, p = functions["loads"].mx_in()
        force, W = functions["loads"](x, u, p)[1], functions["contact_inertia"](x, u, p)[0]
        speed = functions["contact_geometry"](x[: 2 * plant.model.n])[1]
        across, rates = [], []
        for k, point in enumerate(plant.points):
            own = slice(3 * k, 3 * k + 3)
            along = p[p.shape[0] - 5 * (len(plant.points) - k) + 2 :][:2]
            way = ca.vertcat(0, -along[1], along[0])
            mobility = ca.bilin(W[own, own], way, way)
            across.append(mobility - NO_TURN * ca.trace(W[own, own]))
            size = ca.norm_2(speed[3 * k + 1 : 3 * k + 3])
            rates.append(point.friction * force[3 * k] * mobility / size)
        rate = ca.vertcat(*rates)
        by_w = ca.horzcat(ca.jacobian(rate, u), jacobian_by(rate, p, tuned))
        slopes = [ca.jacobian(rate, x), by_w]
        self._rates = ca.Function("rates", [x, u, p], [ca.vertcat(*across), rate, *slopes])

    def can_turn(self, x: Array, u: Array, modes: Modes, k: int) -> bool:
        """Whether forces can move contact ``k`` across the direction in which it slides."""
        return bool(np.array(self._rates(x, u, modes.p)[0])[k] > 0.0)

    def delay(self, x: Array, u: Array, modes: Modes, slope: Array, length: float) -> Array:
        """Derivative of the length of a part of a tick that no event ends.

        Args:
            x: State at its beginning, shape (nx,).
            u: Command that acts, shape (n,).
            modes: Modes of joints and contacts.
            slope: Derivative of x by the state at the beginning of the tick and by what is held.
            length: Of the part in [s].

        Returns:
            Shape (nx + nw,); zero if the length is at the engine's lower bound.
        """
        contact = modes.contact
        slides = (contact["closed"] > 0.0) & (contact["sticks"] == 0.0)
        _, rate, by_x, by_w = (np.array(found) for found in self._rates(x, u, modes.p))
        k = int(np.argmax(np.where(slides, np.nan_to_num(rate.ravel()), 0.0)))
        if not (slides[k] and abs(length * float(rate[k, 0]) - 1.0) < SAME):
            return np.zeros(slope.shape[1])
        change: Array = by_x[k] @ slope
        change[len(x) :] += by_w[k]
        return -(length**2) * change
