# SPDX-License-Identifier: Apache-2.0
"""The energy account of a running simulation, kept while it has readers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.recording.energy_account import EnergyAccount, relative_error


class Account(NamedTuple):
    """Energies in [J]; see ``arm_msgs/Energy``."""

    kinetic: float
    potential: float
    total: float
    input: float
    dissipated: float
    changed: float
    balance: float


class Metered(Protocol):
    """A simulation with an energy account, such as a ``Simulator``."""

    @property
    def x(self) -> Array:
        """Its current state, shape (nx,)."""

    @property
    def command(self) -> Array:
        """Effective command of the last tick, shape (n,)."""

    @property
    def parameters(self) -> Array:
        """Current tunable quantities, shape (np,)."""

    @property
    def energy_account(self) -> EnergyAccount:
        """Computes the account."""


class EnergyMeter:
    """Records every tick cheaply and evaluates the account on request.

    Attributes:
        error: Largest unexplained energy so far, relative to the energy that moved.
    """

    def __init__(self, simulator: Metered) -> None:
        """Open the account at the simulator's current state."""
        self._simulator, self.error = simulator, 0.0
        self._last, self._ticks = simulator.x.copy(), list[tuple[Array, Array, Array]]()
        self._flows, self._changed = np.zeros(2), 0.0
        self._start = self._energies()
        self._most = np.zeros(3)

    def note(self) -> None:
        """Record the last tick."""
        self.note_all(self._simulator.x[None], self._simulator.command[None])

    def note_all(self, x: Array, u: Array) -> None:
        """Record ticks: states after them, shape (k, nx), and effective commands, shape (k, n)."""
        p = np.broadcast_to(self._simulator.parameters, (len(x), len(self._simulator.parameters)))
        self._ticks.append((x.copy(), u.copy(), p))

    def keep_up(self) -> None:
        """Repeat ticks now where the account requires it, so that no later tick waits for many."""
        after = self._ticks[-1][0]
        if self._simulator.energy_account.makes_ticks_again(np.vstack([self._last, after])):
            self._add_up()

    def change(self, action: Callable[[], Any]) -> None:
        """Run an action that changes payload, friction, gravity or state; record its energy."""
        self._add_up()
        before = sum(self._energies())
        action()
        self._last = self._simulator.x.copy()
        self._changed += sum(self._energies()) - before

    def account(self) -> Account:
        """The energies since the account was opened."""
        self._add_up()
        energies = self._energies()
        total, (supplied, lost) = float(sum(energies)), self._flows.tolist()
        balance = total - float(sum(self._start)) - supplied - self._changed + lost
        self._most = np.maximum(self._most, abs(energies - self._start))
        moved = self._most.sum() + abs(supplied) + lost + abs(self._changed)
        self.error = relative_error(balance, moved, max(abs(total), abs(energies[1])))
        kinetic, potential, _ = energies.tolist()
        return Account(kinetic, potential, total, supplied, lost, self._changed, balance)

    def _add_up(self) -> None:
        if self._ticks:
            after, u, p = (np.concatenate(part) for part in zip(*self._ticks, strict=True))
            before = np.vstack([self._last, after[:-1]])
            self._flows += self._simulator.energy_account.flows(before, after, u, p).sum(axis=0)
            self._last, self._ticks = after[-1], []

    def _energies(self) -> Array:
        """Kinetic, potential and stored energy, shape (3,)."""
        simulator = self._simulator
        energies = simulator.energy_account.energies(simulator.x[None], simulator.parameters[None])
        return np.asarray(energies[0])
