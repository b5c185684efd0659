# SPDX-License-Identifier: Apache-2.0
"""Gradients through the ticks of one arm in a scene with events.

Stretches of ticks without events are passed backwards in compiled code, by the transposed
derivative of each tick; ticks with events by their derivatives.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address, pointer
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.derivatives.motion import Motion
from arm_sim.derivatives.nonsmooth_points import NonsmoothPoints
from arm_sim.derivatives.tangents.event_free_ticks import EventFreeTick
from arm_sim.integrators.adjoints import build_adjoint
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_step
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import pullback, scaled_jacobian
from arm_sim.stepping.arm_table import Engine
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.rollouts.lanes import ADDRESS, NUMBER, compile_lanes, lanes_source

# Largest number of ticks that are made in one call
STRETCH = 1024


@dataclass(frozen=True)
class TickPart:
    """One tick, by its derivatives.

    Attributes:
        tick: Number of the tick.
        slope: Derivatives by state, command and all parameters, shape (nx, nx + n + np).
    """

    tick: int
    slope: Array

    def pull_back(self, weight: Array, tau: Array, g: Array, by_tau: Array, by_p: Array) -> Array:
        """Gradient by the state at the beginning of the part.

        Args:
            weight: Gradient by the state at the end of the part, shape (nx,).
            tau: Commands of the whole motion, shape (ticks, n).
            g: Gradients by all states of the function of them, shape (ticks + 1, nx).
            by_tau: Receives gradients by commands, shape (ticks, n).
            by_p: Gradients by parameters, which are added to, shape (np,).
        """
        nx, n = len(weight), tau.shape[1]
        by_x, by_r, tick_by_p = np.split(weight @ self.slope, (nx, nx + n))
        by_tau[self.tick] = by_r
        by_p += tick_by_p
        return np.asarray(by_x + g[self.tick])


@dataclass(frozen=True)
class EventFreePart:
    """Ticks without events.

    Attributes:
        gradients: The scene's code.
        first: Number of the first tick.
        records: A row for each tick: the state before it, the ends of its motions and its modes,
            see ``event_free_gradient.c``.
    """

    gradients: EventFreeGradients
    first: int
    records: Array

    def pull_back(self, weight: Array, tau: Array, g: Array, by_tau: Array, by_p: Array) -> Array:
        """Gradient by the state at the beginning of the part, see ``TickPart``."""
        ticks, gradient = slice(self.first, self.first + len(self.records)), weight.copy()
        weights = np.ascontiguousarray(g[ticks])
        by_commands = np.empty((len(self.records), tau.shape[1]))
        code = self.gradients.code
        code.engine.event_free_gradient(
            code.scene, address(self.records), address(tau[ticks]), self.gradients.length,
            len(self.records), address(weights), address(gradient), address(by_commands),
            address(by_p),
        )  # fmt: skip
        by_tau[ticks] = by_commands
        return gradient


# Successive ticks of a motion
type MotionPart = TickPart | EventFreePart


class EventFreeGradients:
    """Gradients through ticks without events of a scene with events.

    Args:
        nonsmooth: The scene's lasting kinks.
        engine: Finds ticks without events.
        code: Compiled code, of ``event_free_gradient.c``.
        length: Length of a tick in [s].
    """

    def __init__(
        self, nonsmooth: NonsmoothPoints, engine: Engine, code: Compiled, length: float
    ) -> None:
        self._nonsmooth, self._engine, self.code, self.length = nonsmooth, engine, code, length
        code.engine.numbers_per_tick.restype = ctypes.c_longlong
        code.engine.event_free_motion.restype = ctypes.c_longlong
        self._record_size = int(code.engine.numbers_per_tick(code.scene))

    @classmethod
    @one_at_a_time
    def build(
        cls, nonsmooth: NonsmoothPoints, engine: Engine, plant: Plant, choice: Choice
    ) -> EventFreeGradients | None:
        """Build the code of a scene, method and tick; None if that is not possible."""
        event_free = EventFreeTick.of(plant)
        _, *functions = adjoint_tick_functions(plant, choice)
        functions += [*event_free.functions, *event_free.adjoints]
        types = [ADDRESS, ADDRESS, ctypes.c_double, NUMBER, *[ADDRESS] * 4]
        write = partial(lanes_source, plant, choice, functions, more=event_free.members)
        code = compile_lanes(write, 1, "event_free_gradient", types)
        return cls(nonsmooth, engine, code, choice.dt) if code else None

    def advance(self, motion: Motion, tau: Array) -> EventFreePart | None:
        """Advance a motion to its next tick with an event.

        Args:
            motion: The motion; it continues from the end of the ticks.
            tau: Commands of all ticks of the motion, shape (ticks, n), contiguous.

        Returns:
            The ticks before the one with an event; None if there are none.
        """
        first, commands = motion.ticks, tau[motion.ticks :]
        limit = min(STRETCH, self._nonsmooth.ticks_before_kink(motion.x, commands))
        records, after = np.empty((limit, self._record_size)), np.empty(motion.x.shape)
        x = np.ascontiguousarray(motion.x)
        ticks = self.code.engine.event_free_motion(
            self.code.scene, pointer(x), pointer(commands), pointer(motion.p),
            ctypes.c_double(self.length), ctypes.c_longlong(limit), ctypes.byref(self._engine),
            ctypes.c_int(first == 0), pointer(records), pointer(after),
        )  # fmt: skip
        if not ticks:
            return None
        motion.continue_from(after, ticks)
        return EventFreePart(self, first, records[:ticks])


def adjoint_tick_functions(plant: Plant, choice: Choice) -> tuple[ca.Function, ...]:
    """The step, and what passes gradients back through a tick.

    Returns:
        ``step``, its ``adjoint``, ``acting`` (x, r) -> u and ``limit_adjoint`` (x, r, gradient)
        -> gradients by x and r.
    """
    method, n, act = choice.method, plant.model.n, actuation(plant)
    scaled = partial(scaled_jacobian, plant)
    step = build_step(method, plant.rhs, n, plant.mechanics.project, scaled)
    adjoint = build_adjoint(method, plant.rhs, pullback(plant), n, plant.mechanics.project, scaled)
    x, r = (ca.SX.sym(name, act.size1_in(i)) for i, name in enumerate("xr"))
    weight, u = ca.SX.sym("weight", n), act(x, r)
    gradients = [ca.densify(ca.jtimes(u, by, weight, True)) for by in (x, r)]
    limit = ca.Function("limit_adjoint", [x, r, weight], gradients, {"cse": True})
    return step, adjoint, ca.Function("acting", [x, r], [u], {"cse": True}), limit
