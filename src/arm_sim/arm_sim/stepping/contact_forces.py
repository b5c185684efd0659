# SPDX-License-Identifier: Apache-2.0
"""Contact forces at a state."""

from dataclasses import dataclass

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, read_only
from arm_sim.plant.plant import Plant
from arm_sim.stepping.events import Modes
from arm_sim.stepping.stepper import Stepper


@dataclass(frozen=True)
class ContactForce:
    """Force of a plane on the point or ball of a contact.

    Attributes:
        name: Name of the contact.
        state: ``apart``, ``slides`` or ``sticks``; a closed contact without friction slides.
        gap: Distance from the plane in [m].
        normal: Normal force in [N], never negative.
        tangential: Force of friction in the world frame in [N], shape (3,).
        force: Their sum in the world frame in [N], shape (3,). The opposite force acts on the link
            that carries the plane.
        point: Where it acts, in the world frame in [m], shape (3,): the point of the contact, or
            the point of its ball nearest to the plane.
    """

    name: str
    state: str
    gap: float
    normal: float
    tangential: Array
    force: Array
    point: Array


def contact_forces(plant: Plant, stepper: Stepper, x: Array, u: Array) -> tuple[ContactForce, ...]:
    """Forces of the contacts at a state under a torque.

    Args:
        plant: The equation of motion of a scene with contacts.
        stepper: Its compiled ticks.
        x: State, shape (nx,).
        u: Torque that acts, shape (n,).

    Returns:
        A force for each contact, in the order of the scene.

    Raises:
        InvalidInput: If the scene has no contact.
    """
    if not plant.points:
        raise InvalidInput(
            "the scene has no contact; a scene with 'constraints' of type contact is expected"
        )
    contact = plant.mechanics.contact
    assert contact is not None
    modes = stepper.reactions.modes_at(x, u, stepper.p)
    call = stepper.kernel.call
    gaps = call("contact_geometry")(x[: 2 * plant.model.n])[0][::3]
    _, force, *_ = call("loads")(x, u, modes.p)
    force = force.reshape(-1, 3) + _shared(plant, stepper, x, u, modes)
    sites = np.array(contact.sites(x[: plant.model.n])).T.reshape(-1, 4, 3)
    normals, tangents, places = sites[:, 0], sites[:, 1:3], sites[:, 3]
    forces = []
    for i, (contact_point, mode) in enumerate(zip(plant.points, modes.contact, strict=True)):
        state = "apart" if not mode["closed"] else "sticks" if mode["sticks"] else "slides"
        tangential = read_only(force[i, 1:] @ tangents[i])
        total = read_only(tangential + force[i, 0] * normals[i])
        gap, size = float(gaps[i]), float(force[i, 0])
        name, site = contact_point.name, read_only(places[i])
        forces.append(ContactForce(name, state, gap, size, tangential, total, site))
    return tuple(forces)


def _shared(plant: Plant, stepper: Stepper, x: Array, u: Array, modes: Modes) -> Array:
    """Change of contact forces to a distribution within all limits, shape (nc, 3)."""
    change = stepper.reactions.load_sharing(x, u, modes)[0].reshape(-1, 3)
    for k, mode in enumerate(modes.contact):
        if not mode["sticks"]:
            change[k, 1:] = -plant.points[k].friction * change[k, 0] * mode["along"]
    return change
