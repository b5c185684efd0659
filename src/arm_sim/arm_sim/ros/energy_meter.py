# SPDX-License-Identifier: Apache-2.0
"""The energy account of a running simulation, kept while it has readers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.simulator import Simulator


class Account(NamedTuple):
    """Energies in [J]; see ``arm_msgs/Energy``."""

    kinetic: float
    potential: float
    total: float
    input: float
    dissipated: float
    balance: float


class EnergyMeter:
    """Notes every tick cheaply and adds up when asked.

    A tick that must be made again for it is added up at once, so that no tick has to wait for
    many.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Open the account at the simulator's present state."""
        self._simulator = simulator
        self._states, self._commands = [simulator.x.copy()], list[Array]()
        self._flows = np.zeros(2)
        self._start = sum(self._energies())

    def note(self, push: Array | None = None) -> None:
        """Take in the tick that was just made.

        Args:
            push: Joint torques from outside that acted beside the command, shape (n,).
        """
        x = self._simulator.x.copy()
        if push is not None:
            self._flows[0] += push @ (x - self._states[-1])[: len(push)]
        self._commands.append(self._simulator.command)
        self._states.append(x)
        if self._simulator.energy_account.makes_ticks_again(np.array(self._states[-2:])):
            self._add_up()

    def account(self) -> Account:
        """Add up what happened since the account was opened."""
        self._add_up()
        kinetic, potential, stored = self._energies()
        total, (supplied, lost) = kinetic + potential + stored, self._flows.tolist()
        balance = total - self._start - supplied + lost
        return Account(kinetic, potential, total, supplied, lost, balance)

    def _add_up(self) -> None:
        if self._commands:
            x, u = np.array(self._states), np.array(self._commands)
            flows = self._simulator.energy_account.flows(x, u, self._simulator.parameters)
            self._flows += flows.sum(axis=0)
            self._states, self._commands = self._states[-1:], []

    def _energies(self) -> tuple[float, float, float]:
        x, n = self._states[-1], self._simulator.n
        kinetic, potential = self._simulator.dynamics.energy(x[:n], x[n : 2 * n])
        return kinetic, potential, float(self._simulator.energy_account.stored(x[None])[0])
