# SPDX-License-Identifier: Apache-2.0
"""Forces and energy losses of the contacts of a recorded run."""

from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_sim.recording.recording import Recording
from arm_sim.simulation.simulator import Simulator
from arm_sim.stepping.contact_forces import contact_forces


@dataclass(frozen=True)
class ContactHistory:
    """Forces and losses of the contacts of a recorded run; arrays are read-only.

    Attributes:
        names: Names of the nc contacts.
        gap: Distances from the planes in [m], shape (k+1, nc).
        force: Forces of the planes on the contact points in the world frame in [N], shape
            (k+1, nc, 3).
        point: Their points of action in the world frame in [m], shape (k+1, nc, 3).
        impact_loss: Energy lost in impacts up to each time in [J], shape (k+1,).
        friction_loss: Energy lost in friction of contacts, likewise.
    """

    names: tuple[str, ...]
    gap: Array
    force: Array
    point: Array
    impact_loss: Array
    friction_loss: Array


def contact_history(sim: Simulator, recording: Recording) -> ContactHistory:
    """Forces and losses of a run, computed by repeating its ticks.

    Args:
        sim: The simulator that recorded it; its state does not change.
        recording: The run.

    Returns:
        The history.

    Raises:
        InvalidInput: If the scene has no contact.
    """
    compiled = sim.arm.compiled
    stepper, x, u, p = compiled.replay_stepper, recording.x, recording.command, recording.p
    forces = []
    for state, command, tuned in zip(x, u, p, strict=True):
        stepper.p[:] = tuned
        forces.append(contact_forces(compiled.plant, stepper, state, command))
    losses = compiled.energy_account.contact_losses(x[:-1], u[:-1], p[:-1])
    losses[~recording.moved] = 0.0
    losses = np.vstack([np.zeros(2), np.cumsum(losses, axis=0)])
    return ContactHistory(
        tuple(f.name for f in forces[0]),
        read_only([[f.gap for f in row] for row in forces]),
        read_only([[f.force for f in row] for row in forces]),
        read_only([[f.point for f in row] for row in forces]),
        *map(read_only, losses.T),
    )
