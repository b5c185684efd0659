# SPDX-License-Identifier: Apache-2.0
"""Impacts: velocities that jump where a contact point meets its plane.

Newton's restitution for the normal, Coulomb's law for the tangential impulse and the speed after
(Moreau, "Unilateral contact and dry friction in finite freedom dynamics", CISM 302, 1988). Both
together may add energy (Kane, Levinson, Dynamics, Theory and Applications, 1985); then the rebound
is lowered. The same lines stand in C in ``native/contact_impact.c``.
"""

from __future__ import annotations

import numpy as np

from arm_dynamics.model.arm import Array
from arm_sim.stepping.contact_cone import several
from arm_sim.stepping.contact_modes import Modes
from arm_sim.stepping.contact_newton import Does

# Halvings that find the highest rebound that adds no energy.
HALVINGS = 60
# Impacts in one tick after which the contacts of that tick do not rebound any more.
MOST_REBOUNDS = 500


def impact(modes: Modes, x: Array, u: Array, p: Array, rebounds: bool) -> float | None:
    """Change the velocities in x where a touching contact approaches.

    Newton's restitution with Coulomb's friction. Where that would add energy, which it can
    with friction, the rebound is the highest that does not. A rebound that would not rise
    above the rounding of the gap is none: the contact closes.

    Args:
        modes: Of the contacts.
        x: State, changed.
        u: Torque that acts.
        p: Parameters; what they say of joints and contacts is overwritten.
        rebounds: Whether there is restitution at all.

    Returns:
        Energy lost in [J]; None if no impulse is found.
    """
    modes.modes(p)[:, :2] = 0.0
    modes.directions(p)[:] = 1.0
    touching, before = modes.touching(x, u, p), modes.geometry(x)[1].copy()
    hits = np.logical_and(touching, before[::3] < -modes.calm(x))
    if not hits.any():
        return 0.0
    W, B, _ = (value.copy() for value in modes.inertia(x, u, p))
    rebound = np.where(hits, -modes.restitution * before[::3], 0.0)
    rebound[(rebound <= modes.hop(x, u, p)) | (not rebounds)] = 0.0
    impulse, gain = impulse_for(modes, W, before, rebound, touching)
    low, high = 0.0, 1.0
    if gain > 0.0 and rebound.any():
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            gain = impulse_for(modes, W, before, middle * rebound, touching)[1]
            low, high = (low, middle) if gain > 0.0 else (middle, high)
        impulse, gain = impulse_for(modes, W, before, low * rebound, touching)
    if impulse is None:
        return None
    modes.velocity(x)[:] += B @ impulse
    return -gain


def impulse_for(
    modes: Modes, W: Array, before: Array, rebound: Array, touching: Array
) -> tuple[Array | None, float]:
    """Impulses that let contacts rebound.

    Args:
        modes: Of the contacts.
        W: Change of their speeds per impulse in [1/kg], shape (3 nc, 3 nc).
        before: Speeds before in [m/s], shape (3 nc,).
        rebound: Speeds of rebound in [m/s], shape (nc,).
        touching: Which may carry, shape (nc,).

    Returns:
        Impulses in [N s], shape (3 nc,), None if there are none, and the energy gained in [J].
    """
    c = before.copy()
    c[::3] -= rebound
    answers = several(W, c, modes.mu, [None] * modes.nc, touching)
    if any(answer.does == Does.UNSOLVABLE for answer in answers):
        return None, 0.0
    impulse = np.concatenate([answer.force for answer in answers])
    return impulse, float(impulse @ (before + 0.5 * W @ impulse))
