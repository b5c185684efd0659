# SPDX-License-Identifier: Apache-2.0
"""What a run leaves behind."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.model import Array
from arm_sim.energy import dissipated_work, input_work
from arm_sim.state import State


@dataclass(frozen=True)
class Recording:
    """States at the beginning of a run and after each of its k ticks; arrays are read-only.

    Attributes:
        time: In [s], shape (k+1,).
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n).
        tau: Torques that act from each time on, limits applied, in [N m] or [N], shape (k+1, n);
            the last row repeats the last tick's.
        error: Estimated error of q in [rad] or [m], shape (k+1,); zeros without error control.
        dynamics: The scene's dynamics, for the energies.
        held: Names of the constraints that held.
    """

    time: Array
    q: Array
    v: Array
    tau: Array
    error: Array
    dynamics: Dynamics
    held: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of recorded states."""
        return len(self.time)

    @cached_property
    def _energies(self) -> tuple[Array, Array]:
        return self.dynamics.energy(self.q, self.v)

    @property
    def kinetic(self) -> Array:
        """Kinetic energy in [J], shape (k+1,)."""
        return self._energies[0]

    @property
    def potential(self) -> Array:
        """Potential energy in [J], shape (k+1,)."""
        return self._energies[1]

    @property
    def energy(self) -> Array:
        """Kinetic plus potential energy in [J], shape (k+1,)."""
        return self.kinetic + self.potential

    @cached_property
    def multipliers(self) -> Array:
        """λ of the constraints in [N] and [N m], shape (k+1, m): see ``constrained_forward``."""
        return self.dynamics.constrained_forward(self.q, self.v, self.tau, self.held)[1]

    @cached_property
    def balance(self) -> Array:
        """Energy from nowhere in [J], shape (k+1,): E - E(0) - input + dissipated."""
        given = input_work(self.q, self.tau[:-1])
        lost = dissipated_work(self.time, self.q, self.v, self.dynamics.friction)
        gained: Array = self.energy - self.energy[0]
        return gained - given + lost


def record(
    dynamics: Dynamics,
    dt: float,
    start: State,
    trace: Array,
    effort: Array,
    errors: Array,
    held: tuple[str, ...] = (),
) -> Recording:
    """Put a recording together.

    Args:
        dynamics: The scene's dynamics.
        dt: Length of a tick in [s].
        start: State before the first of k ticks.
        trace: State (q, v) after each tick, shape (k, 2n).
        effort: Torque that acted in each tick, shape (k, n).
        errors: Estimated error after each tick, shape (k,).
        held: Names of the constraints that hold.

    Returns:
        The recording; its arrays are read-only.
    """
    n = len(start.q)
    x = np.vstack([np.concatenate([start.q, start.v]), trace[:, : 2 * n]])
    tau = np.vstack([effort, effort[-1:] if len(effort) else np.zeros(n)])
    error = np.concatenate([[start.error], errors])
    time = np.asarray((start.step + np.arange(len(x))) * dt, dtype=np.float64)
    for array in (x, tau, error, time):
        array.setflags(write=False)
    return Recording(time, x[:, :n], x[:, n:], tau, error, dynamics, held)
