# SPDX-License-Identifier: Apache-2.0
"""The energy account of a running simulation, for plots."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import ArmError

_log = logging.getLogger(__name__)


class Energies(Protocol):
    """Energies in [J] since an account was opened, as of an ``Account``."""

    @property
    def kinetic(self) -> float:
        """Current kinetic energy."""

    @property
    def potential(self) -> float:
        """Current potential energy of gravity and springs."""

    @property
    def total(self) -> float:
        """Both, and the energy stored in drives and bristles."""

    @property
    def input(self) -> float:
        """Work supplied."""

    @property
    def dissipated(self) -> float:
        """Heat lost."""

    @property
    def changed(self) -> float:
        """Energy added by changes of the scene."""

    @property
    def balance(self) -> float:
        """Unexplained energy: the integration error."""


class Meter(Protocol):
    """Keeps an account, as an ``EnergyMeter``."""

    def note(self) -> None:
        """Record a tick."""

    def change(self, action: Callable[[], None]) -> None:
        """Run an action that changes the scene."""

    def account(self) -> Energies:
        """The energies since the account was opened."""


class LiveAccount:
    """An energy account whose equations are built in the background.

    Ticks do not wait for that: the account opens with the first after it.

    Args:
        build: Builds the equations of accounts; called on a separate thread.
        open_meter: Opens an account at the current state.
        stores: Whether drives or bristles store energy.

    Attributes:
        names: Names of the energies of ``now``.
    """

    def __init__(
        self, build: Callable[[], None], open_meter: Callable[[], Meter], stores: bool
    ) -> None:
        self._build, self._open_meter, self._stores = build, open_meter, stores
        self._built: Future[bool] | None = None
        self._meter: Meter | None = None
        stored: Sequence[str] = ("stored",) if stores else ()
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
            self._meter = self._open_meter()

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
            self._build()
        except ArmError as error:
            _log.warning("no energy account is kept: %s", error)
            return False
        return True
