# SPDX-License-Identifier: Apache-2.0
"""The energy account of a running simulation, kept while it has readers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.recording.energy_account import EnergyAccount, relative_error
from arm_sim.simulation.simulated_arm import SimulatedArm


class Account(NamedTuple):
    """Energies in [J], see ``arm_msgs/Energy``, and the number of ticks after which they hold."""

    kinetic: float
    potential: float
    total: float
    input: float
    dissipated: float
    changed: float
    balance: float
    step: int


class _Moment(NamedTuple):
    """A state between two ticks."""

    account: EnergyAccount
    x: Array
    p: Array
    step: int

    @classmethod
    def of(cls, arm: SimulatedArm) -> _Moment:
        """The current state of an arm."""
        x, p = arm.x.copy(), arm.parameters.copy()
        return cls(arm.compiled.energy_account, x, p, arm.step_count)

    def energies(self) -> Array:
        """Kinetic, potential and stored energy in [J], shape (3,)."""
        return np.asarray(self.account.energies(self.x[None], self.p[None])[0])


class _Ticks(NamedTuple):
    """Ticks in a row: states after each, effective commands, and tunable quantities."""

    account: EnergyAccount
    x: Array
    u: Array
    p: Array
    step: int


class _Jump(NamedTuple):
    """A change of payload, friction, gravity or state."""

    before: _Moment
    after: _Moment


class EnergyMeter:
    """Records every tick and change, and evaluates the account on request.

    Ticks and changes are recorded by the ticking thread, which computes nothing for it. Other
    threads may evaluate the account at any time.

    Attributes:
        error: Unexplained energy of the last account, relative to the largest that moved in any.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        """Open the account at the arm's current state."""
        self._arm, self.error = arm, 0.0
        self._records, self._evaluation_lock = deque[_Ticks | _Jump](), Lock()
        self._start: Array | None = None
        self._last = _Moment.of(arm)  # up to which the account is evaluated
        self._flows, self._changed, self._extremes = np.zeros(2), 0.0, np.zeros(3)

    def note(self) -> None:
        """Record the last tick."""
        self.note_all(self._arm.x[None], self._arm.acted[None], self._arm.step_count)

    def note_all(self, x: Array, u: Array, step: int) -> None:
        """Record ticks.

        Args:
            x: States after the ticks, shape (k, nx).
            u: Effective commands of the ticks, shape (k, n).
            step: Number of ticks since the last reset, these included.
        """
        arm = self._arm
        p = arm.parameters.copy()
        self._records.append(_Ticks(arm.compiled.energy_account, x.copy(), u.copy(), p, step))

    def change(self, action: Callable[[], Any]) -> None:
        """Run an action that changes payload, friction, gravity or state; record its energy."""
        before = _Moment.of(self._arm)
        action()
        self._records.append(_Jump(before, _Moment.of(self._arm)))

    def account(self) -> Account:
        """The energies since the account was opened."""
        with self._evaluation_lock:
            if self._start is None:
                self._start = self._last.energies()
            self._add_up()
            energies, (supplied, lost) = self._last.energies(), self._flows.tolist()
            total = float(sum(energies))
            balance = total - float(sum(self._start)) - supplied - self._changed + lost
            self._extremes = np.maximum(self._extremes, abs(energies - self._start))
            turnover = self._extremes.sum() + abs(supplied) + lost + abs(self._changed)
            self.error = relative_error(balance, turnover, max(abs(total), abs(energies[1])))
            kinetic, potential, _ = energies.tolist()
            step = self._last.step
            return Account(kinetic, potential, total, supplied, lost, self._changed, balance, step)

    def _add_up(self) -> None:
        """Evaluate the records; ticks between two changes at once."""
        ticks = list[_Ticks]()
        for _ in range(len(self._records)):
            record = self._records.popleft()
            if isinstance(record, _Ticks):
                ticks.append(record)
                continue
            self._add_ticks(ticks)
            ticks, self._last = [], record.after
            self._changed += float(sum(record.after.energies()) - sum(record.before.energies()))
        self._add_ticks(ticks)

    def _add_ticks(self, ticks: Sequence[_Ticks]) -> None:
        """Add work and heat of ticks of the same scene."""
        if not ticks:
            return
        last = ticks[-1]
        x = np.concatenate([self._last.x[None], *(part.x for part in ticks)])
        u = np.concatenate([part.u for part in ticks])
        p = np.repeat([part.p for part in ticks], [len(part.x) for part in ticks], axis=0)
        self._flows += last.account.flows(x[:-1], x[1:], u, p).sum(axis=0)
        self._last = _Moment(last.account, x[-1], last.p, last.step)
