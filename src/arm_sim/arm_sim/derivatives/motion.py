# SPDX-License-Identifier: Apache-2.0
"""Motions of one arm that are differentiated tick by tick."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.derivatives.one_sided import TickPoint
from arm_sim.derivatives.tangents import Arms, Tangents
from arm_sim.derivatives.tick_derivatives import TickDerivatives
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.stepping.adaptive import copy_of

# Largest number of ticks without events that are differentiated at a time
STRETCH = 64


class Motion:
    """A motion of one arm that is differentiated tick by tick.

    Args:
        derivatives: Derivatives of single ticks.
        x: State at the beginning, shape (nx,).
        p: Tunable numbers.
        side: 1 or -1: ticks without a derivative are given their one-sided derivatives, see
            ``one_sided``; None: they are refused.

    Attributes:
        x: The state now.
        p: Tunable numbers.
        ticks: Number of ticks so far.
    """

    def __init__(self, derivatives: TickDerivatives, x: Array, p: Array, side: int | None) -> None:
        self.x, self.p, self.ticks = x, np.ascontiguousarray(p), 0
        self._derivatives, self._side = derivatives, side
        self._control = derivatives.new_control()

    def continue_from(self, x: Array, ticks: int) -> None:
        """Continue from a state that other code has reached after some ticks."""
        self.x, self.ticks = x, self.ticks + ticks

    def differentiate_tick(self, r: Array) -> Array:
        """Make a tick under a command, and return its derivatives, see ``Linearizer.__call__``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        derivatives, point = self._derivatives, TickPoint(self.x, r, self.p)
        is_first, control = self.ticks == 0, copy_of(self._control)
        try:
            x, slope = derivatives.differentiate(point, control, strict=True, is_first=is_first)
        except NotDifferentiable:
            if self._side is None:
                raise
            slope = derivatives.differentiate_one_side(point, self._control, is_first, self._side)
            control = copy_of(self._control)
            x = derivatives.advance(point, control)
        self._control = control
        self.continue_from(x, 1)
        return slope


def propagate_arm(
    derivatives: TickDerivatives, arms: Arms, arm: int, side: int | None
) -> Iterator[Array]:
    """Propagate the columns of one arm; they are yielded after each of its ticks."""
    motion, columns = Motion(derivatives, arms.x[arm], arms.p[arm], side), arms.initial[arm]
    tau, held, nx = arms.tau[arm], arms.held[arm], len(columns)
    event_free = derivatives.compiled.event_free
    while (k := motion.ticks) < len(tau):
        stretch = min(STRETCH, derivatives.nonsmooth.ticks_before_kink(motion.x, tau[k:]))
        if event_free and stretch:
            ahead = slice(k, k + stretch)
            after_each = _event_free_columns(event_free, motion, tau[ahead], held[ahead], columns)
            yield from after_each
            if len(after_each):
                columns, k = after_each[-1], motion.ticks
            if len(after_each) == stretch:
                continue
        slope = motion.differentiate_tick(tau[k])
        columns = slope[:, :nx] @ columns + slope[:, nx:] @ held[k]
        yield columns


def _event_free_columns(
    event_free: Tangents, motion: Motion, tau: Array, held: Array, columns: Array
) -> Array:
    """Advance a motion to its next tick with an event; columns after each tick before that."""
    arm = Arms(
        motion.x[None], tau[None], motion.p[None], np.ascontiguousarray(columns)[None], held[None]
    )
    after_each, _, end, (ticks,) = event_free.propagate(
        arm, threads=1, lanes=1, every=True, is_first=motion.ticks == 0
    )
    motion.continue_from(end[0], int(ticks))
    return after_each[0, :ticks]


@contextmanager
def named_in_errors(arm: int, arms: int, tick: int | None = None) -> Iterator[None]:
    """Name the arm in errors, if there are several, and always with a tick."""
    try:
        yield
    except (SimulationDiverged, NotDifferentiable) as error:
        if tick is None and arms == 1:
            raise
        label = f"arm {arm}" if tick is None else f"arm {arm}, time step {tick}"
        raise type(error)(f"{label}: {error}") from None
