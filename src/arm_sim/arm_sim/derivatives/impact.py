# SPDX-License-Identifier: Apache-2.0
"""Residual of Newton's and Coulomb's impact laws, and its derivatives."""

from collections.abc import Sequence

import casadi as ca

from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import expanded_function, jacobian_by


def impact_function(plant: Plant, p_indices: Sequence[int] = ()) -> ca.Function:
    """What ``native/derivatives/impact_derivatives.h`` requires.

    Args:
        plant: Equations of a scene with contacts or rigid stops.
        p_indices: Indices in p of the quantities to differentiate by.

    Returns:
        ``impact_laws`` (q and v before it, p, restitutions of joints and of contacts, 1 for
        contacts that carry an impulse and for those that stick, impulses) -> velocities after it,
        those of the contacts, and derivatives by (q, v) and quantities side by side, and by
        impulses: of the velocities, and of the residual.
    """
    n, nc = plant.model.n, len(plant.points)
    modes = plant.rhs.numel_in(2)
    x, p, e, f, carries, sticks, impulse = arguments = [
        ca.MX.sym(name, size)
        for name, size in (
            ("x", 2 * n), ("p", modes), ("e", n), ("f", nc),
            ("carries", nc), ("sticks", nc), ("r", 3 * nc),
        )
    ]  # fmt: skip
    place = len(plant.parameters.nominal)
    impacts = 1 - p[place : place + n] if plant.layout.directions else ca.MX(n, 1)
    v = x[n:]
    after = plant.mechanics.impact_map(x, p, -impacts * (1 + e) * v, impulse)[0]
    residual = speed_after = ca.MX(0, 1)
    if contact := plant.mechanics.contact:
        speed_before, speed_after = (contact.geometry(ca.vertcat(x[:n], w))[1] for w in (v, after))
        residual = _residuals(plant, speed_before, speed_after, f, (carries, sticks), impulse)
    results = [after, speed_after]
    for y in (after, residual):
        results.append(ca.horzcat(ca.jacobian(y, x), jacobian_by(y, p, p_indices)))
        results.append(ca.jacobian(y, impulse))
    return expanded_function("impact_laws", arguments, results)


def _residuals(
    plant: Plant, before: ca.MX, after: ca.MX, f: ca.MX, modes: tuple[ca.MX, ca.MX], impulse: ca.MX
) -> ca.MX:
    """Residuals of all contacts, along the normal and the tangents, zero in an impact.

    Args:
        plant: The plant.
        before: Velocities of all contacts before the impact, shape (3 contacts,).
        after: Velocities of all contacts after the impact, shape (3 contacts,).
        f: Coefficients of restitution, shape (contacts,).
        modes: 1 for each contact that carries a load, and for each that sticks, else 0.
        impulse: Impulses of all contacts, shape (3 contacts,).
    """
    (carries, sticks), residuals = modes, list[ca.MX]()
    for k, point in enumerate(plant.points):
        rows = slice(3 * k, 3 * k + 3)
        restitution_residual = after[rows.start] + f[k] * before[rows.start]
        push, speed = impulse[rows], after[rows][1:]
        tangential = push[1:]
        if point.friction > 0.0:
            tangential = tangential + point.friction * push[0] * speed / ca.norm_2(speed)
        tangential = ca.if_else(sticks[k] > 0, speed, tangential)
        residuals.append(ca.if_else(carries[k] > 0, restitution_residual, push[0]))
        residuals.append(ca.if_else(carries[k] > 0, tangential, push[1:]))
    return ca.vertcat(*residuals)
