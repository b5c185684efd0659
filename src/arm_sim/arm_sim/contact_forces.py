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
    if not plant.points:
        raise InvalidInput("the scene has no contact; its 'constraints' may name some")
    modes = stepper.modes_at(x, u)
    call = stepper.kernel.call
    gaps = call("contact_geometry")(x[: 2 * plant.model.n])[0][::3]
    force = call("loads")(x, u, modes.p)[1].reshape(-1, 3)
    answers = []
    for point, mode, gap, r in zip(plant.points, modes.contact, gaps, force, strict=True):
        state = "apart" if not mode["closed"] else "sticks" if mode["sticks"] else "slides"
        tangential = read_only(r[1:] @ point.axes[1:])
        whole = read_only(tangential + r[0] * point.axes[0])
        answers.append(ContactForce(point.name, state, float(gap), float(r[0]), tangential, whole))
    return tuple(answers)


def trouble(stepper: Stepper) -> str:
    """What contacts had to do with a tick that could not be computed; else nothing."""
    return _WHY.get(Trouble(stepper.report.trouble), "")
