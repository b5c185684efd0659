# SPDX-License-Identifier: Apache-2.0
"""The energy account of a running simulation, for plots."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ArmError
from arm_sim.simulation.energy_meter import EnergyMeter
from arm_sim.simulation.simulator import Simulator

_log = logging.getLogger(__name__)


class LiveAccount:
    """An energy account whose equations are built in the background.

    Ticks do not wait for that: the account opens with the first after it.

    Args:
        simulator: Whose account it is.

    Attributes:
        names: Names of the energies of ``now``.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._arm, self._stores = simulator.arm, bool(simulator.z_names)
        self._built: Future[bool] | None = None
        self._meter: EnergyMeter | None = None
        stored: Sequence[str] = ("stored",) if self._stores else ()
        self.names = (
            "kinetic", "potential", *stored, "supplied", "lost", "balance"
        )  # fmt: skip

    @property
    def in_preparation(self) -> bool:
        """Whether equations are being built."""
        return self._built is not None and not self._built.done()

    def prepare(self) -> None:
        """Start building its equations; without this, no account is kept."""
        pool = ThreadPoolExecutor(1, "energy account")
        self._built = pool.submit(self._try_to_build)
        pool.shutdown(wait=False)  # the thread ends with its job

    def note(self) -> None:
        """Record the last tick."""
        if self._meter is not None:
            self._meter.note()
        elif self._built is not None and self._built.done() and self._built.result():
            self._meter = EnergyMeter(self._arm)

    def change(self, action: Callable[[], None]) -> None:
        """Run a change that recompiles the scene; the account continues when it is built."""
        if self._built is None:
            action()
            return
        self._built.result()  # equations are built one after another
        action() if self._meter is None else self._meter.change(action)
        self.prepare()

    def forget(self) -> None:
        """Restart with the next tick."""
        self._meter = None

    def now(self) -> Array | None:
        """Energies in [J], in the order of ``names``; None while there is no account."""
        if self._meter is None or self.in_preparation:
            return None
        account = self._meter.account()
        kinetic, potential = account.kinetic, account.potential
        stored = [account.total - kinetic - potential] if self._stores else []
        supplied, lost = account.input + account.changed, account.dissipated
        return np.array([kinetic, potential, *stored, supplied, lost, account.balance])

    def _try_to_build(self) -> bool:
        try:
            self._arm.compiled.energy_account.prepare()
        except ArmError as error:
            _log.warning("no energy account is kept: %s", error)
            return False
        return True
