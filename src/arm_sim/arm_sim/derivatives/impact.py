# SPDX-License-Identifier: Apache-2.0
"""What is zero in an impact, by Newton's and Coulomb's laws, and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from arm_sim.derivatives.guards import expanded
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import jacobian_by


def impact_function(plant: Plant, tuned: Sequence[int] = ()) -> ca.Function:
    """What ``native/derivatives/impact_derivatives.h`` requires.

    Args:
        plant: Equations of a scene with contacts or rigid stops.
        tuned: Places in p of the quantities to differentiate by.

    Returns:
        ``impact_laws`` (q and v before it, p, restitutions of joints and of contacts, 1 for
        contacts that carry an impulse and for those that stick, impulses) -> velocities after it,
        those of the contacts, and derivatives by (q, v) and quantities side by side, and by
        impulses: of the velocities, and of what is zero in an impact.
    """
    n, nc = plant.model.n, len(plant.points)
    modes = plant.rhs.numel_in(2)
    x, p, e, f, carries, sticks, r = given = [
        ca.MX.sym(name, size)
        for name, size in (
            ("x", 2 * n), ("p", modes), ("e", n), ("f", nc),
            ("carries", nc), ("sticks", nc), ("r", 3 * nc),
        )
    ]  # fmt: skip
    place = len(plant.parameters.nominal)
    meets = 1 - p[place : place + n] if plant.layout.directions else ca.MX(n, 1)
    v = x[n:]
    after = plant.mechanics.impact_map(x, p, -meets * (1 + e) * v, r)[0]
    law = speed = ca.MX(0, 1)
    if contact := plant.mechanics.contact:
        met, speed = (contact.geometry(ca.vertcat(x[:n], w))[1] for w in (v, after))
        law = _laws(plant, met, speed, f, (carries, sticks), r)
    found = [after, speed]
    for y in (after, law):
        found.append(ca.horzcat(ca.jacobian(y, x), jacobian_by(y, p, tuned)))
        found.append(ca.jacobian(y, r))
    return expanded("impact_laws", given, found)


def _laws(
    plant: Plant, met: ca.MX, speed: ca.MX, f: ca.MX, modes: tuple[ca.MX, ca.MX], r: ca.MX
) -> ca.MX:
    """What is zero in an impact of all contacts, see ``_law``, by velocities before and after."""
    laws: list[ca.MX] = []
    for k, point in enumerate(plant.points):
        here = slice(3 * k, 3 * k + 3)
        obeyed = speed[here.start] + f[k] * met[here.start]
        carries, sticks = (mode[k] for mode in modes)
        laws += _law(speed[here], r[here], obeyed, (carries, sticks), point.friction)
    return ca.vertcat(*laws)


def _law(
    speed: ca.MX, r: ca.MX, obeyed: ca.MX, modes: tuple[ca.MX, ca.MX], friction: float
) -> tuple[ca.MX, ca.MX]:
    """What is zero in an impact of a contact, along the normal and the tangents.

    Args:
        speed: Its velocity afterwards, shape (3,).
        r: Its impulse, likewise.
        obeyed: Zero by the law of restitution.
        modes: Whether it carries a load, and sticks.
        friction: Its coefficient.
    """
    carries, sticks = modes
    slides = r[1:]
    if friction > 0.0:
        s = speed[1:]
        slides = slides + friction * r[0] * s / ca.norm_2(s)
    moves = ca.if_else(sticks > 0, speed[1:], slides)
    return ca.if_else(carries > 0, obeyed, r[0]), ca.if_else(carries > 0, moves, r[1:])
