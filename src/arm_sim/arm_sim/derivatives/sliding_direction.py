# SPDX-License-Identifier: Apache-2.0
"""Rate at which friction turns the direction of sliding contacts.

The engine limits the length of parts of a tick by it (``find_reach`` in ``native/segments.h``), so
their length depends on the state.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from arm_dynamics.equations.contact import Mode
from arm_sim.derivatives.guards import expanded
from arm_sim.plant.plant import Plant

# Mobility across the direction of sliding, relative to the whole, that is rounding.
NO_TURN = 1e-12


def starts_to_slide(plant: Plant, p: ca.SX) -> ca.SX:
    """Whether a contact starts to slide under the modes in p, 1 or 0: it keeps its direction."""
    mode, starts = Mode.of(plant.parts(p)[-1]), ca.SX(0)
    for k, point in enumerate(plant.points):
        if point.friction > 0.0:
            starts = ca.logic_or(starts, mode.closed[k] * (1 - mode.sticks[k]) * mode.fixed[k])
    return starts


def turning_functions(plant: Plant, tuned: Sequence[int] = ()) -> tuple[ca.Function, ca.Function]:
    """How fast friction turns the directions in which contacts slide.

    Args:
        plant: Equations of a scene with contacts.
        tuned: Places in p of the quantities to differentiate by.

    Returns:
        ``turning`` (x, u, p) -> a number that is positive where forces can move a contact across
        its direction, and the rate in [1/s], of each contact; ``turning_gradient``
        (x, u, p, weights) -> gradients of the weighed sum of rates by x, and by u and quantities.
    """
    functions = plant.events
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
    rate, weights = ca.vertcat(*rates), ca.MX.sym("weights", len(rates))
    by_x, by_u, by_p = (ca.jtimes(rate, by, weights, True) for by in (x, u, p))
    by_w = ca.vertcat(by_u, by_p[list(tuned)]) if tuned else by_u
    return (
        expanded("turning", [x, u, p], [ca.vertcat(*across), rate]),
        expanded("turning_gradient", [x, u, p, weights], [by_x, by_w]),
    )
