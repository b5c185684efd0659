# SPDX-License-Identifier: Apache-2.0
"""Keeps the energy account of a running simulation, while somebody wants to see it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from arm_dynamics.dynamics import Dynamics
from arm_dynamics.model import Array
from arm_sim.energy import dissipated_work, input_work
from arm_sim.state import State


class Account(NamedTuple):
    """Energies in [J]; see ``arm_msgs/Energy``."""

    kinetic: float
    potential: float
    total: float
    input: float
    dissipated: float
    balance: float


class EnergyMeter:
    """Notes every tick cheaply and adds up when asked."""

    def __init__(self, dynamics: Dynamics, dt: float, start: State) -> None:
        """Open the account at the state ``start``, with ticks of ``dt`` in [s]."""
        self._dynamics, self._dt = dynamics, dt
        self._states, self._torques = [start], list[Array]()
        self._input = self._dissipated = 0.0
        self._start = sum(dynamics.energy(start.q, start.v))

    def note(self, tau: Array, state: State) -> None:
        """Take in one tick: the torque that acted and the state it led to."""
        self._torques.append(tau)
        self._states.append(state)

    def account(self) -> Account:
        """Add up what happened since the account was opened."""
        if self._torques:
            q = np.array([state.q for state in self._states])
            v = np.array([state.v for state in self._states])
            time = self._dt * np.arange(len(q))
            self._input += input_work(q, np.array(self._torques))[-1]
            self._dissipated += dissipated_work(time, q, v, self._dynamics.friction)[-1]
            self._states, self._torques = self._states[-1:], []
        last = self._states[-1]
        kinetic, potential = self._dynamics.energy(last.q, last.v)
        total = kinetic + potential
        balance = total - self._start - self._input + self._dissipated
        return Account(kinetic, potential, total, self._input, self._dissipated, balance)
