# SPDX-License-Identifier: Apache-2.0
"""What a run leaves behind."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array, read_only
from arm_sim.plant.plant import Plant
from arm_sim.recording.energy_account import EnergyAccount


@dataclass(frozen=True)
class Recording:
    """States at the beginning of a run and after each of its k ticks; arrays are read-only.

    Attributes:
        time: In [s], shape (k+1,).
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n).
        z: States of the scene's laws, shape (k+1, nz).
        command: What was commanded from each time on, limits applied, shape (k+1, n): torques in
            [N m] or [N], or what a joint's drive takes; the last row repeats the last tick's.
        error: Estimated error of q in [rad] or [m], shape (k+1,); zeros without error control.
        time_stepped: By each time, ticks in which events piled up; see ``State``, shape (k+1,).
        dynamics: The scene's dynamics, for the energies.
        plant: The scene's equation of motion.
        account: What keeps the energy account, when asked.
        p: Tunable quantities during the run, shape (np,).
        held: Names of the constraints that held.
    """

    time: Array
    q: Array
    v: Array
    z: Array
    command: Array
    error: Array
    time_stepped: Array
    dynamics: Dynamics
    plant: Plant
    account: EnergyAccount
    p: Array
    held: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of recorded states."""
        return len(self.time)

    @cached_property
    def tau(self) -> Array:
        """Torques that act on the joints from each time on in [N m] or [N], shape (k+1, n).

        The command, or what a joint's drive makes of it by the end of the tick.
        """
        after = np.vstack([self._x[1:], self._x[-1:]])
        return read_only(self.plant.joint_torque(after, self.command))

    @cached_property
    def _energies(self) -> tuple[Array, Array]:
        return self.dynamics.energy(self.q, self.v)

    @property
    def kinetic(self) -> Array:
        """Kinetic energy in [J], shape (k+1,)."""
        return self._energies[0]

    @property
    def potential(self) -> Array:
        """Potential energy of weight and springs in [J], shape (k+1,)."""
        return self._energies[1]

    @cached_property
    def stored(self) -> Array:
        """What the laws store in [J], shape (k+1,): in flexible drives, coils, bristles."""
        return self.account.stored(self._x)

    @cached_property
    def energy(self) -> Array:
        """Kinetic, potential and stored energy in [J], shape (k+1,)."""
        return self.kinetic + self.potential + self.stored

    @property
    def supplied(self) -> Array:
        """Work that came in by each time in [J], shape (k+1,): torque or voltage at work."""
        return self._flows[:, 0]

    @property
    def lost(self) -> Array:
        """Heat that went out by each time in [J], shape (k+1,): friction, windings, damping."""
        return self._flows[:, 1]

    @cached_property
    def stop_torque(self) -> Array:
        """Torques with which stops hold joints back from each time on in [N m] or [N], (k+1, n).

        See ``Simulator.stop_torque``.
        """
        stepper, torque = self.account.stepper, np.zeros_like(self.q)
        stepper.p[:] = self.p
        for k in np.flatnonzero(self.plant.model.stops.touched(self.q).any(axis=1)):
            torque[k] = stepper.stop_torque(self._x[k], self.command[k])
        return read_only(torque)

    @cached_property
    def multipliers(self) -> Array:
        """λ of the constraints in [N] and [N m], shape (k+1, m): see ``constrained_forward``."""
        tau = self.plant.joint_torque(self._x, self.command)
        if self.plant.events and self.plant.project:
            stepper = self.account.stepper
            stepper.p[:] = self.p
            pairs = zip(self._x, self.command, strict=True)
            tau = tau + np.array([stepper.push(*pair) for pair in pairs])
        return self.dynamics.constrained_forward(self.q, self.v, tau, self.held)[1]

    @cached_property
    def balance(self) -> Array:
        """Energy from nowhere in [J], shape (k+1,): E - E(0) - supplied + lost."""
        gained: Array = self.energy - self.energy[0]
        return gained - self.supplied + self.lost

    @property
    def _x(self) -> Array:
        return np.hstack([self.q, self.v, self.z])

    @cached_property
    def _flows(self) -> Array:
        flows = self.account.flows(self._x, self.command[:-1], self.p)
        return np.vstack([np.zeros(2), np.cumsum(flows, axis=0)])
