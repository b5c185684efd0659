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

# Ticks that are made in one call
STRETCH = 1024


@dataclass(frozen=True)
class TickPart:
    """One tick, by its derivatives.

    Attributes:
        tick: Its number.
        slope: Derivatives by state, command and all parameters, shape (nx, nx + n + np).
    """

    tick: int
    slope: Array

    def back(self, weight: Array, tau: Array, g: Array, by_tau: Array, by_p: Array) -> Array:
        """Gradient by the state at the beginning of the part.

        Args:
            weight: That by the state at its end, shape (nx,).
            tau: Commands of the whole motion, shape (ticks, n).
            g: Gradients by its states of a function of all of them, shape (ticks + 1, nx).
            by_tau: Receives gradients by commands, shape (ticks, n).
            by_p: Gradients by parameters, which are added to, shape (np,).
        """
        nx, n = len(weight), tau.shape[1]
        by_x, by_r, by_p_here = np.split(weight @ self.slope, (nx, nx + n))
        by_tau[self.tick] = by_r
        by_p += by_p_here
        return np.asarray(by_x + g[self.tick])


@dataclass(frozen=True)
class EventFreePart:
    """Ticks without events.

    Attributes:
        gradients: What differentiates them.
        first: Number of the first tick.
        kept: Of each tick x before it, the ends of its motions and its modes, in a row: see
            ``event_free_gradient.c``.
    """

    gradients: EventFreeGradients
    first: int
    kept: Array

    def back(self, weight: Array, tau: Array, g: Array, by_tau: Array, by_p: Array) -> Array:
        """As of ``TickPart``."""
        ticks, gradient = slice(self.first, self.first + len(self.kept)), weight.copy()
        weights = np.ascontiguousarray(g[ticks])
        by_commands = np.empty((len(self.kept), tau.shape[1]))
        code = self.gradients.code
        code.engine.event_free_gradient(
            code.scene, address(self.kept), address(tau[ticks]), self.gradients.length,
            len(self.kept), address(weights), address(gradient), address(by_commands),
            address(by_p),
        )  # fmt: skip
        by_tau[ticks] = by_commands
        return gradient


# Some ticks of a motion
type Part = TickPart | EventFreePart


class EventFreeGradients:
    """Gradients through ticks without events of a scene with events.

    Args:
        nonsmooth: Its lasting kinks.
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
        self._kept = int(code.engine.numbers_per_tick(code.scene))

    @classmethod
    @one_at_a_time
    def built(
        cls, nonsmooth: NonsmoothPoints, engine: Engine, plant: Plant, choice: Choice
    ) -> EventFreeGradients | None:
        """Those of a scene's equations, method and tick; None if code cannot be built."""
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
            motion: The motion.
            tau: Commands of all its ticks, shape (ticks, n), contiguous.

        Returns:
            The ticks before that one; None if there are none.
        """
        first, ahead = motion.ticks, tau[motion.ticks :]
        most = min(STRETCH, self._nonsmooth.ticks_before(motion.x, ahead))
        kept, after = np.empty((most, self._kept)), np.empty(motion.x.shape)
        x = np.ascontiguousarray(motion.x)
        ticks = self.code.engine.event_free_motion(
            self.code.scene, pointer(x), pointer(ahead), pointer(motion.p),
            ctypes.c_double(self.length), ctypes.c_longlong(most), ctypes.byref(self._engine),
            ctypes.c_int(first == 0), pointer(kept), pointer(after),
        )  # fmt: skip
        if not ticks:
            return None
        motion.go_on(after, ticks)
        return EventFreePart(self, first, kept[:ticks])


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
    back = [ca.densify(ca.jtimes(u, by, weight, True)) for by in (x, r)]
    limit = ca.Function("limit_adjoint", [x, r, weight], back, {"cse": True})
    return step, adjoint, ca.Function("acting", [x, r], [u], {"cse": True}), limit
