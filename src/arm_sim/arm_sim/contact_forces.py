# SPDX-License-Identifier: Apache-2.0
"""What contacts did: forces at a state, a run's forces and losses, and why a tick failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.exceptions import ConstraintError
from arm_dynamics.model.arm import Array
from arm_sim.plant.plant import Plant
from arm_sim.recording.contact_losses import ContactLosses
from arm_sim.recording.recording import Recording
from arm_sim.stepping.contact import ContactStepper
from arm_sim.stepping.contact_driver import INSIDE
from arm_sim.stepping.contact_modes import Trouble
from arm_sim.stepping.stepper import Stepper

if TYPE_CHECKING:
    from arm_sim.simulator import Simulator

_WHY = {
    Trouble.EVENTS: "; contacts touch or slip without end in it",
    Trouble.UNDETERMINED: (
        "; no single motion of its contacts obeys all laws: friction presses a sliding contact "
        "together faster than the normal force opens it (Painlevé's paradox), or contacts jam"
    ),
    Trouble.INSIDE: "; a contact point is inside its plane",
}


@dataclass(frozen=True)
class ContactForce:
    """Force of a plane on the arm.

    Attributes:
        name: Of the contact.
        state: ``apart``, ``slides`` or ``sticks``; a contact without friction that carries slides.
        gap: Distance from the plane in [m].
        normal: Normal force in [N], never negative.
        tangential: Force of friction in the world frame in [N], shape (3,).
        force: Both together in the world frame in [N], shape (3,).
    """

    name: str
    state: str
    gap: float
    normal: float
    tangential: Array
    force: Array


@dataclass(frozen=True)
class ContactHistory:
    """What the contacts of a recorded run did; arrays are read-only.

    Attributes:
        names: Of the nc contacts.
        gap: Distances from the planes in [m], shape (k+1, nc).
        force: Forces of the planes on the arm in the world frame in [N], shape (k+1, nc, 3).
        impact_loss: Energy that impacts have taken out by each time in [J], shape (k+1,).
        friction_loss: Energy that friction of contacts has, likewise.
    """

    names: tuple[str, ...]
    gap: Array
    force: Array
    impact_loss: Array
    friction_loss: Array


def contact_forces(sim: Simulator) -> tuple[ContactForce, ...]:
    """Forces of the contacts at the simulator's state, under the torque of its last tick.

    Args:
        sim: A simulator of a scene with contacts.

    Returns:
        One for each contact, in the order of the scene.

    Raises:
        InvalidInput: If the scene has no contact.
    """
    state = sim.state
    return _forces(_contact_stepper(sim), np.concatenate([state.q, state.v]), sim.effort)


def contact_history(sim: Simulator, recording: Recording) -> ContactHistory:
    """Forces and losses of a run, found by computing its ticks again.

    Args:
        sim: The simulator that recorded it; its state does not change.
        recording: The run.

    Returns:
        The history.

    Raises:
        InvalidInput: If the scene has no contact.
    """
    stepper = _contact_stepper(sim)
    x = np.hstack([recording.q, recording.v])
    forces = [_forces(stepper, *pair) for pair in zip(x, recording.tau, strict=True)]
    losses = ContactLosses(sim.plant, sim.choice, sim.backend)(x, recording.tau[:-1], recording.p)
    losses = np.vstack([np.zeros(2), np.cumsum(losses, axis=0)])
    arrays = (
        np.array([[f.gap for f in row] for row in forces]),
        np.array([[f.force for f in row] for row in forces]),
        *losses.T,
    )
    for array in arrays:
        array.setflags(write=False)
    return ContactHistory(tuple(f.name for f in forces[0]), *arrays)


def outside(plant: Plant, x: Array) -> Array:
    """Refuse a state with a contact point inside its plane.

    Args:
        plant: The scene's equations.
        x: State, shape (nx,).

    Returns:
        The same state.

    Raises:
        ConstraintError: Naming the point that is deepest, and how deep; a nanometre is rounding.
    """
    if plant.contact is None:
        return x
    gaps = np.array(plant.contact.geometry(x[: 2 * plant.model.n])[0]).ravel()[::3]
    points = plant.contact.points
    k = int(np.argmin(gaps))
    if gaps[k] < -INSIDE:
        depths = {point.name: float(gap) for point, gap in zip(points, gaps, strict=True)}
        raise ConstraintError(
            f"contact '{points[k].name}' is {-gaps[k]:.6g} m inside its plane; "
            "a position at or above it is wanted",
            depths,
        )
    return x


def trouble(stepper: Stepper) -> str:
    """What contacts had to do with a tick that could not be computed; else nothing."""
    if not isinstance(stepper, ContactStepper):
        return ""
    return _WHY.get(Trouble(stepper.memory.trouble), "")


def _contact_stepper(sim: Simulator) -> ContactStepper:
    stepper = sim._stepper
    if not isinstance(stepper, ContactStepper):
        raise InvalidInput("the scene has no contact; its 'constraints' may name some")
    return stepper


def _forces(stepper: ContactStepper, x: Array, u: Array) -> tuple[ContactForce, ...]:
    p = stepper.parameters_at(x, u)
    gaps, force = stepper.modes.geometry(x)[0][::3].copy(), stepper.modes.look(x, u, p)[0]
    answers = []
    for point, mode, gap, r in zip(
        stepper.points, stepper.modes.modes(p), gaps, force.reshape(-1, 3), strict=True
    ):
        state = "apart" if not mode[0] else "sticks" if mode[1] else "slides"
        tangential = r[1:] @ point.axes[1:]
        whole = tangential + r[0] * point.axes[0]
        for array in (tangential, whole):
            array.setflags(write=False)
        normal = float(r[0])
        answers.append(ContactForce(point.name, state, float(gap), normal, tangential, whole))
    return tuple(answers)
