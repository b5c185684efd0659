# SPDX-License-Identifier: Apache-2.0
"""Motions of one arm that are differentiated tick by tick."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.derivatives.one_sided import TickPoint
from arm_sim.derivatives.tangents import Arms, Tangents
from arm_sim.derivatives.tick_derivatives import TickDerivatives, copied
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged

# Ticks without events that are differentiated at a time.
STRETCH = 64


class Motion:
    """A motion of one arm that is differentiated tick by tick.

    Args:
        derivatives: Of its ticks.
        x: State at the beginning, shape (nx,).
        p: Tunable numbers.
        side: 1 or -1: ticks without a derivative are given their one-sided derivatives, see
            ``one_sided``; None: they are refused.

    Attributes:
        x: The state now.
        p: Tunable numbers.
        ticks: Number of ticks that are behind.
    """

    def __init__(self, derivatives: TickDerivatives, x: Array, p: Array, side: int | None) -> None:
        self.x, self.p, self.ticks = x, np.ascontiguousarray(p), 0
        self._derivatives, self._side = derivatives, side
        self._control = derivatives.control()

    def go_on(self, x: Array, ticks: int) -> None:
        """Continue from a state that other code has reached after some ticks."""
        self.x, self.ticks = x, self.ticks + ticks

    def slope(self, r: Array) -> Array:
        """Make a tick under a command; its derivatives, as of ``Linearizer.__call__``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        derivatives, point = self._derivatives, TickPoint(self.x, r, self.p)
        begins, control = self.ticks == 0, copied(self._control)
        try:
            x, slope = derivatives.differentiated(point, control, True, begins)
        except NotDifferentiable:
            if self._side is None:
                raise
            slope = derivatives.one_sided(point, self._control, begins, self._side)
            control = copied(self._control)
            x = derivatives.after(point, control)
        self._control = control
        self.go_on(x, 1)
        return slope


def columns_of_one(
    derivatives: TickDerivatives, arms: Arms, arm: int, side: int | None
) -> Iterator[Array]:
    """Columns after each tick of one arm."""
    motion, columns = Motion(derivatives, arms.x[arm], arms.p[arm], side), arms.initial[arm]
    tau, held, nx = arms.tau[arm], arms.held[arm], len(columns)
    event_free = derivatives.compiled.event_free
    while (k := motion.ticks) < len(tau):
        most = min(STRETCH, derivatives.nonsmooth.ticks_before(motion.x, tau[k:]))
        if event_free and most:
            ahead = slice(k, k + most)
            passed = _event_free_columns(event_free, motion, tau[ahead], held[ahead], columns)
            yield from passed
            if len(passed):
                columns, k = passed[-1], motion.ticks
            if len(passed) == most:
                continue
        slope = motion.slope(tau[k])
        columns = slope[:, :nx] @ columns + slope[:, nx:] @ held[k]
        yield columns


def _event_free_columns(
    event_free: Tangents, motion: Motion, tau: Array, held: Array, columns: Array
) -> Array:
    """Advance a motion to its next tick with an event; columns after each tick before that."""
    arm = Arms(
        motion.x[None], tau[None], motion.p[None], np.ascontiguousarray(columns)[None], held[None]
    )
    begins = motion.ticks == 0
    after_each, _, end, (ticks,) = event_free.columns(arm, True, 1, 1, begins=begins)
    motion.go_on(end[0], int(ticks))
    return after_each[0, :ticks]


@contextmanager
def naming(arm: int, arms: int, tick: int | None = None) -> Iterator[None]:
    """Name the arm in errors, if there are several, and always with a tick."""
    try:
        yield
    except (SimulationDiverged, NotDifferentiable) as error:
        if tick is None and arms == 1:
            raise
        label = f"arm {arm}" if tick is None else f"arm {arm}, time step {tick}"
        raise type(error)(f"{label}: {error}") from None
