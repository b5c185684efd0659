# SPDX-License-Identifier: Apache-2.0
"""Sliding contacts whose direction is not differentiable."""

from __future__ import annotations

import casadi as ca

from arm_dynamics.equations.contact import Mode
from arm_sim.derivatives.guards import expanded
from arm_sim.plant.plant import Plant

# Mobility across the direction of sliding, relative to the whole, that is rounding.
NO_TURN = 1e-12


def starts_to_slide(plant: Plant, p: ca.SX) -> ca.SX:
    """Whether a contact starts to slide under the modes in p, 1 or 0: it keeps its direction."""
    mode, starts = Mode.of(plant.layout.parts(p)[-1]), ca.SX(0)
    for k, point in enumerate(plant.points):
        if point.friction > 0.0:
            starts = ca.logic_or(starts, mode.closed[k] * (1 - mode.sticks[k]) * mode.fixed[k])
    return starts


def mobility_across(plant: Plant) -> ca.Function:
    """``across`` (x, u, p) -> a number for each contact of a scene.

    It is positive where forces can move the contact across its direction of sliding.
    """
    inertia, across = plant.events["contact_inertia"], list[ca.MX]()
    x, u, p = inertia.mx_in()
    W = inertia(x, u, p)[0]
    for k in range(len(plant.points)):
        own = slice(3 * k, 3 * k + 3)
        along = p[p.shape[0] - 5 * (len(plant.points) - k) + 2 :][:2]
        way = ca.vertcat(0, -along[1], along[0])
        across.append(ca.bilin(W[own, own], way, way) - NO_TURN * ca.trace(W[own, own]))
    return expanded("across", [x, u, p], [ca.vertcat(*across)])
