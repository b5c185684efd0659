# SPDX-License-Identifier: Apache-2.0
"""What contacts did: forces at a state, a run's forces and losses, and why a tick failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, read_only
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_sim.compiled_scene import CompiledScene
from arm_sim.recording.recording import Recording
from arm_sim.stepping.events import Trouble
from arm_sim.stepping.stepper import Stepper

_WHY = {
    Trouble.UNDETERMINED: (
        "; no single motion of its contacts obeys all laws: friction presses a sliding contact "
        "together faster than the normal force opens it (Painlevé's paradox), or contacts jam"
    ),
    Trouble.INSIDE: "; a contact point is inside its plane",
    Trouble.STOP: (
        f"; a joint meets its stop, and events need compiled code: {HOW_TO_GET_CODE}; "
        "limits.stop: false takes a stop away"
    ),
}


@dataclass(frozen=True)
class ContactForce:
    """Force of a plane on what touches it.

    Attributes:
        name: Of the contact.
        state: ``apart``, ``slides`` or ``sticks``; a contact without friction that carries slides.
        gap: Distance from the plane in [m].
        normal: Normal force in [N], never negative.
        tangential: Force of friction in the world frame in [N], shape (3,).
        force: Both together in the world frame in [N], shape (3,). The opposite acts on the link
            that carries the plane.
        point: Where it acts, in the world frame in [m], shape (3,): the point, or that of the ball
            which is nearest to the plane.
    """

    name: str
    state: str
    gap: float
    normal: float
    tangential: Array
    force: Array
    point: Array


@dataclass(frozen=True)
class ContactHistory:
    """What the contacts of a recorded run did; arrays are read-only.

    Attributes:
        names: Of the nc contacts.
        gap: Distances from the planes in [m], shape (k+1, nc).
        force: Forces of the planes on what touches them in the world frame in [N], shape
            (k+1, nc, 3).
        point: Where they act in the world frame in [m], shape (k+1, nc, 3).
        impact_loss: Energy that impacts have taken out by each time in [J], shape (k+1,).
        friction_loss: Energy that friction of contacts has, likewise.
    """

    names: tuple[str, ...]
    gap: Array
    force: Array
    point: Array
    impact_loss: Array
    friction_loss: Array


class _Simulated(Protocol):
    @property
    def compiled(self) -> CompiledScene: ...


def contact_history(sim: _Simulated, recording: Recording) -> ContactHistory:
    """Forces and losses of a run, found by computing its ticks again.

    Args:
        sim: The simulator that recorded it; its state does not change.
        recording: The run.

    Returns:
        The history.

    Raises:
        InvalidInput: If the scene has no contact.
    """
    compiled, x = sim.compiled, np.hstack([recording.q, recording.v, recording.z])
    forces = [contact_forces(compiled, *pair) for pair in zip(x, recording.command, strict=True)]
    losses = compiled.energy_account.contact_losses(
        x[:-1], recording.command[:-1], recording.p[:-1]
    )
    losses = np.vstack([np.zeros(2), np.cumsum(losses, axis=0)])
    return ContactHistory(
        tuple(f.name for f in forces[0]),
        read_only([[f.gap for f in row] for row in forces]),
        read_only([[f.force for f in row] for row in forces]),
        read_only([[f.point for f in row] for row in forces]),
        *map(read_only, losses.T),
    )


def contact_forces(compiled: CompiledScene, x: Array, u: Array) -> tuple[ContactForce, ...]:
    """Forces of the contacts at a state under a torque.

    Args:
        compiled: A scene with contacts.
        x: State, shape (nx,).
        u: Torque that acts, shape (n,).

    Returns:
        One for each contact, in the order of the scene.

    Raises:
        InvalidInput: If the scene has no contact.
    """
    plant, stepper = compiled.plant, compiled.stepper
    if plant.contact is None:
        raise InvalidInput("the scene has no contact; its 'constraints' may name some")
    modes = stepper.modes_at(x, u)
    call = stepper.kernel.call
    gaps = call("contact_geometry")(x[: 2 * plant.model.n])[0][::3]
    force = call("loads")(x, u, modes.p)[1].reshape(-1, 3)
    sites = np.array(plant.contact.sites(x[: plant.model.n])).T.reshape(-1, 4, 3)
    answers = []
    for i, mode in enumerate(modes.contact):
        state = "apart" if not mode["closed"] else "sticks" if mode["sticks"] else "slides"
        normal, tangents, point = sites[i, 0], sites[i, 1:3], sites[i, 3]
        tangential = read_only(force[i, 1:] @ tangents)
        whole = read_only(tangential + force[i, 0] * normal)
        number = float(gaps[i]), float(force[i, 0])
        answers.append(
            ContactForce(plant.points[i].name, state, *number, tangential, whole, read_only(point))
        )
    return tuple(answers)


def trouble(stepper: Stepper) -> str:
    """What contacts had to do with a tick that could not be computed; else nothing."""
    return _WHY.get(Trouble(stepper.report.trouble), "")
