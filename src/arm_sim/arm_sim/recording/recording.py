# SPDX-License-Identifier: Apache-2.0
"""What a run leaves behind."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array, read_only
from arm_sim.imperfections import Measured
from arm_sim.plant.plant import Plant
from arm_sim.recording.changes import Jump
from arm_sim.recording.energy_account import TRUSTED, EnergyAccount, relative_error

_log = logging.getLogger(__name__)


@dataclass(frozen=True, repr=False)
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
        dynamics: The arm's dynamics at the end of the run.
        plant: The scene's equation of motion.
        account: What keeps the energy account, when asked.
        p: Tunable quantities from each time on, shape (k+1, np).
        held: Names of the constraints that held.
        jumps: What the controller changed between two ticks.
        measured: What the scene's sensors told at each time; None if it has none.
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
    jumps: tuple[Jump, ...] = ()
    measured: Measured | None = None

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
    def _energies(self) -> Array:
        return self.account.energies(self._x, self.p)

    @property
    def kinetic(self) -> Array:
        """Kinetic energy in [J], shape (k+1,)."""
        return self._energies[:, 0]

    @property
    def potential(self) -> Array:
        """Potential energy of weight and springs in [J], shape (k+1,)."""
        return self._energies[:, 1]

    @property
    def stored(self) -> Array:
        """What the laws store in [J], shape (k+1,): in flexible drives, coils, bristles."""
        return self._energies[:, 2]

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
        for k in self._at_stops:
            stepper.p[:] = self.p[k]
            torque[k] = stepper.stop_torque(self._x[k], self.command[k])
        return read_only(torque)

    @cached_property
    def _at_stops(self) -> Sequence[int]:
        """Times at which a joint is at a stop."""
        return np.flatnonzero(self.plant.model.stops.touched(self.q).any(axis=1)).tolist()

    @cached_property
    def multipliers(self) -> Array:
        """λ of the constraints in [N] and [N m], shape (k+1, m): see ``constrained_forward``."""
        outside = self.plant.parameters.place("external")
        tau = np.array(self.plant.joint_torque(self._x, self.command))
        tau += 0.0 if outside is None else self.p[:, outside]
        if self.plant.events and self.plant.project:
            stepper = self.account.stepper
            for k in self._at_stops if self.plant.free else range(len(self)):
                stepper.p[:] = self.p[k]
                tau[k] += stepper.push(self._x[k], self.command[k])
        return self.account.multipliers(self._x, tau, self.p, self.held)

    @cached_property
    def balance(self) -> Array:
        """Energy from nowhere in [J], shape (k+1,): E - E(0) - supplied - changed + lost."""
        start = self.energy[0] - self.changed[0]
        balance: Array = self.energy - start - self.supplied - self.changed + self.lost
        return balance

    @cached_property
    def changed(self) -> Array:
        """What changes between ticks had put in by each time in [J], shape (k+1,).

        Of payload, gravity or friction, by ``set_parameter`` and its like, and of the state, by
        ``set_state`` and ``set_constraint``, while the run went on.
        """
        changed = np.zeros(len(self))
        for jump in self.jumps:
            before = self.account.energies(jump.x[None], jump.p[None]).sum()
            changed[jump.row] = self.energy[jump.row] - before
        return np.cumsum(changed)

    @cached_property
    def energy_error(self) -> float:
        """Largest energy from nowhere, relative to the energy that moved; inf if it is unknown.

        Above 1e-3 the motion is not to be trusted: a warning is logged once for each recording.
        """
        parts = np.column_stack([self._energies, self.supplied, self.lost, self.changed])
        moved = float(np.ptp(parts, axis=0).sum())
        balance = float(np.max(abs(self.balance)))
        error = relative_error(balance, moved, float(abs(self._energies).max()))
        if error > TRUSTED:
            _log.warning("%s; a smaller dt or a tolerance is expected", self._told(error))
        return error

    @property
    def trusted(self) -> bool:
        """Whether the energy account is off by no more than 1e-3 of the energy that moved."""
        return self.energy_error <= TRUSTED

    def __repr__(self) -> str:
        """One line: how long, of what, and whether it is to be trusted if that is known.

        It is looked at here where that is cheap: where no tick has to be made again.
        """
        known = "energy_error" in vars(self) or not self.account.makes_ticks_again(self._x)
        told = self._told(self.energy_error) if known else "energy account not looked at yet"
        span = f"{self.time[0]:g} to {self.time[-1]:g} s"
        return f"<Recording: {len(self) - 1} ticks, {span}, {self.q.shape[1]} joints; {told}>"

    @staticmethod
    def _told(error: float) -> str:
        if error <= TRUSTED:
            return f"energy account closed to {error:.2g} of the energy that moved"
        return (
            f"not to be trusted: the energy account is off by {error:.2g} of the energy that "
            f"moved, more than {TRUSTED:g}"
        )

    @property
    def _x(self) -> Array:
        return np.hstack([self.q, self.v, self.z])

    @cached_property
    def _flows(self) -> Array:
        x, after = self._x, self._x[1:].copy()
        for jump in self.jumps:
            if jump.row > 0:
                after[jump.row - 1] = jump.x
        flows = self.account.flows(x[:-1], after, self.command[:-1], self.p[:-1])
        return np.vstack([np.zeros(2), np.cumsum(flows, axis=0)])
