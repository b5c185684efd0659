# SPDX-License-Identifier: Apache-2.0
"""The energy account of a running simulation, from the trail of ticks that C keeps."""

from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np

from arm_sim.ros.ticks import Ticks
from arm_sim.simulation.energy_meter import Account, EnergyMeter
from arm_sim.simulation.simulated_arm import SimulatedArm

ROWS = 8192  # ticks that C keeps until they are noted


class EnergyTrail:
    """Energies of an arm since the account was opened; closed at first.

    C keeps states and efforts of the last ticks (``ticks_t`` of ticks.h), which are evaluated when
    the account is read, by any thread. Only the ticking thread opens, closes and changes it.
    """

    def __init__(self, arm: SimulatedArm, ticks: Ticks) -> None:
        """Let C keep the ticks of an arm here."""
        self._arm, self._ticks, self._lock = arm, ticks, Lock()
        self._states, self._efforts = np.zeros((ROWS, arm.plant.nx)), np.zeros((ROWS, arm.n))
        self._steps = np.zeros(ROWS, np.int64)  # negative: brakes held the arm
        ticks.state_trail, ticks.effort_trail = self._states.ctypes.data, self._efforts.ctypes.data
        ticks.ticks = self._steps.ctypes.data
        self._meter: EnergyMeter | None = None

    @property
    def is_open(self) -> bool:
        """Whether it is kept."""
        return self._meter is not None

    def set_open(self, needed: bool) -> None:
        """Open it if it is needed, or close it if it is not."""
        with self._lock:
            self._ticks.rows = ROWS if needed else 0
            if not needed:
                self._meter = None
            elif self._meter is None:
                self._ticks.kept_count = self._ticks.noted_count = 0
                self._meter = EnergyMeter(self._arm)

    def note(self) -> None:
        """Evaluate the ticks executed so far."""
        with self._lock:
            noted, kept, meter = self._ticks.noted_count, self._ticks.kept_count, self._meter
            if kept == noted or meter is None:
                return
            rows = np.arange(noted, kept) % ROWS
            moved, last = rows[self._steps[rows] > 0], abs(self._steps[rows[-1]])
            meter.note_all(self._states[moved], self._efforts[moved], int(last))
            self._ticks.noted_count = kept

    def note_before_full(self) -> None:
        """Evaluate the ticks executed so far if C has no room for further ones."""
        if self._ticks.kept_count - self._ticks.noted_count >= ROWS:
            self.note()

    def change(self, action: Callable[[], Any]) -> None:
        """Run a function that changes state or model, and note the energy of that."""
        if self._meter is None:
            action()
        else:
            self.note()
            self._meter.change(action)

    def read(self) -> Account | None:
        """Energies since it was opened; None while it is closed."""
        self.note()
        meter = self._meter
        return None if meter is None else meter.account()

    @property
    def error(self) -> float:
        """Unexplained energy when last read, relative to the energy that moved; else 0."""
        return 0.0 if self._meter is None else self._meter.error
