# SPDX-License-Identifier: Apache-2.0
"""Derivatives of single ticks, and motions of one arm that are differentiated tick by tick."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import built_once, one_at_a_time
from arm_sim.derivatives.events import EventfulTicks, acting, diverged
from arm_sim.derivatives.nonsmooth_points import NonsmoothPoints
from arm_sim.derivatives.one_sided import TickPoint, one_sided
from arm_sim.derivatives.tangents import Arms, Tangents
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_step
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import scaled_jacobian
from arm_sim.stepping.adaptive import SubstepControl, controlled_tick, within_reach
from arm_sim.stepping.arm_table import Engine
from arm_sim.stepping.lanes import alike
from arm_sim.stepping.stepper import Stepper

# Ticks without events that are differentiated at a time.
STRETCH = 64
UNSETTLED = "the derivatives of a step do not settle as it is divided"


@sealed
class TickDerivatives:
    """Derivatives of single ticks by state and command, and by some tunable quantities.

    Those quantities are held, as the command is: where derivatives lie side by side, columns for
    the command come after those for the state, and columns for the quantities after these.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        stepper: Runs its ticks and determines the modes of joints and contacts.
        backend: As for ``Kernel``.
        tuned: Places in p of the quantities to differentiate by.
    """

    @one_at_a_time
    def __init__(
        self,
        plant: Plant,
        choice: Choice,
        stepper: Stepper,
        backend: str,
        tuned: Sequence[int] = (),
    ) -> None:
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self._backend, self._tuned, self._held = backend, tuned, plant.model.n + len(tuned)
        self.nonsmooth = NonsmoothPoints(plant)

    def prepare_events(self) -> None:
        """Compile what ticks with events need, unless that is done or there are none."""
        if self._eventful:
            _ = self._events

    @cached_property
    def _smooth_ticks(self) -> Tangents | None:
        """Compiled code for ticks that meet neither stops nor events; None if there is none."""
        return self._free_tangents if self._in_lanes else self.event_free

    @cached_property
    def _in_lanes(self) -> bool:
        """Whether arms away from their stops are differentiated side by side."""
        return alike(self._plant, self._choice) and self._free_tangents.native

    @cached_property
    def event_free(self) -> Tangents | None:
        """Compiled code for ticks without events of a scene with events."""
        native = self.engine and self._backend != "vm" and self._scene_tangents.native
        return self._scene_tangents if native else None

    @cached_property
    def _free_tangents(self) -> Tangents:
        """Derivatives of ticks and steps of the arm away from its stops."""
        if self._plant.free is None:
            return self._scene_tangents
        return Tangents(self._plant.free, self._choice, self._backend, self._tuned)

    @built_once
    def _scene_tangents(self) -> Tangents:
        """Derivatives of all steps of the scene, in modes that are arguments."""
        return Tangents(self._plant, self._choice, self._backend, self._tuned, self.engine)

    @cached_property
    def engine(self) -> Engine | None:
        """What finds the modes of ticks of fixed length in a scene with events."""
        fixed_steps = self._choice.tolerance is None
        return Engine.of(self._stepper) if self._eventful and fixed_steps else None

    def differentiated(
        self, point: TickPoint, control: SubstepControl | None, strict: bool, begins: bool
    ) -> tuple[Array, Array]:
        """State after one tick, and its derivatives by state, command and quantities.

        Args:
            point: State, command and parameters.
            control: State of the error control, which the tick changes.
            strict: Whether to refuse a tick that begins or ends on the boundary of a mode.
            begins: Whether the state is varied, see ``may_go_on``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        if strict and (reason := self.nonsmooth.reason(point.x, point.r)):
            raise NotDifferentiable(f"linearize: {reason}")
        compiled = None if self._eventful else self._smooth_ticks
        if compiled:
            x, r = point.x[None], point.r[None]
            after, slopes, lost = compiled.slopes(x, r, point.p, 1, 1, 1, begins)
            if not lost:
                return after[0], slopes[0]
        if self._eventful:
            state, slope = self._events.tick(point, control, strict, begins)
        else:
            state, slope = self._tick_by_steps(point, control)
        if not np.isfinite(slope).all():
            raise NotDifferentiable(f"linearize: {UNSETTLED}{self._choice.remark}")
        return state, slope

    def on_either_side(
        self, point: TickPoint, control: SubstepControl | None, begins: bool
    ) -> Array:
        """Derivatives of one tick; on the boundary between two modes, those of either."""
        try:
            return self.differentiated(point, copied(control), True, begins)[1]
        except NotDifferentiable:
            return self.differentiated(point, copied(control), False, begins)[1]

    def after(self, point: TickPoint, control: SubstepControl | None) -> Array:
        """State after a tick, shape (nx,); the tick changes ``control``."""
        if self._eventful:
            return self._events.after(point, control)
        return self.differentiated(point, control, strict=False, begins=False)[0]

    def control(self) -> SubstepControl | None:
        """State of the error control at the beginning of a motion; None without."""
        order, tolerance = self._choice.method.order, self._choice.tolerance
        return None if tolerance is None else SubstepControl(tolerance, order)

    def one_sided(
        self, point: TickPoint, control: SubstepControl | None, begins: bool, side: int
    ) -> Array:
        """One-sided derivatives of a tick, see ``one_sided``."""
        return one_sided(
            lambda at: self.after(at, copied(control)),
            lambda at: self.on_either_side(at, control, begins),
            point, side, self._tuned, self._entries,
        )  # fmt: skip

    @cached_property
    def _entries(self) -> list[str]:
        """What a tick is differentiated by, for messages."""
        model, laws = self._plant.model, self._plant.laws
        names = [f"the {quantity} of joint '{name}'" for quantity in ("position", "velocity")
                 for name in model.joint_names]  # fmt: skip
        names += [f"the {name}" for name in (laws.names if laws else ())]
        names += [f"the command of joint '{name}'" for name in model.joint_names]
        return names + [f"parameter {k}" for k in self._tuned]

    @property
    def _eventful(self) -> bool:
        return self._plant.eventful and self._stepper.kernel.native

    @built_once
    def _events(self) -> EventfulTicks:
        engine = self._stepper.compiled
        assert engine is not None
        return EventfulTicks(self._plant, self._choice, engine, self._scene_tangents, self._tuned)

    def _tick_by_steps(
        self, point: TickPoint, control: SubstepControl | None
    ) -> tuple[Array, Array]:
        """State after a tick without events, step by step, and its derivatives."""
        x, r, p = point.x, point.r, point.p
        if self._plant.model.stops.touched(x[: len(r)]).any():
            raise NotDifferentiable(
                f"linearize: a joint is at its stop, which needs compiled code: {HOW_TO_GET_CODE}"
            )
        u, u_x, u_r = (np.array(value) for value in self._actuation(x, r))
        modes, nx = self._stepper.modes_at(x, u).p, self._plant.nx
        modes[: len(p)] = p
        held = np.eye(self._held + 1, nx + self._held, nx)  # lengths are constant
        slope, after = np.eye(nx, nx + self._held), x
        for h in self._lengths(x, u.ravel(), modes, control):
            after, slope = self._scene_tangents.step(after, u, modes, h, np.vstack([slope, held]))
        if not within_reach(after):
            raise diverged(self._choice)
        by_x, by_u, by_p = np.split(slope, (nx, nx + len(r)), axis=1)
        return after, np.hstack([by_x + by_u @ u_x, by_u @ u_r, by_p])

    @built_once
    def _actuation(self) -> ca.Function:
        return acting(self._plant)

    def _lengths(
        self, x: Array, u: Array, p: Array, control: SubstepControl | None
    ) -> list[float]:
        """Lengths of the steps of a tick without events, which change ``control``."""
        if control is None:
            return [self._choice.dt]
        lengths, attempt = list[float](), self._attempt.call("attempt")
        if not controlled_tick(attempt, x.copy(), u, p, self._choice.dt, control, lengths):
            raise diverged(self._choice)
        return lengths

    @built_once
    def _attempt(self) -> Kernel:
        plant, method, n = self._plant, self._choice.method, self._plant.model.n
        project, scaled = plant.mechanics.project, partial(scaled_jacobian, plant)
        function = build_step(
            method, plant.rhs, n, project, scaled, "attempt", scale=plant.laws.scale
        )
        return Kernel([function], "vm")


class Motion:
    """A motion of one arm that is differentiated tick by tick.

    Args:
        linearizer: Of its ticks.
        x: State at the beginning, shape (nx,).
        p: Tunable numbers.
        side: 1 or -1: ticks without a derivative are given their one-sided derivatives, see
            ``one_sided``; None: they are refused.

    Attributes:
        x: The state now.
        p: Tunable numbers.
        ticks: Number of ticks that are behind.
    """

    def __init__(self, linearizer: TickDerivatives, x: Array, p: Array, side: int | None) -> None:
        self.x, self.p, self.ticks = x, np.ascontiguousarray(p), 0
        self._linearizer, self._side = linearizer, side
        self._control = linearizer.control()

    def go_on(self, x: Array, ticks: int) -> None:
        """Continue from a state that other code has reached after some ticks."""
        self.x, self.ticks = x, self.ticks + ticks

    def slope(self, r: Array) -> Array:
        """Make a tick under a command; its derivatives, as of ``Linearizer.__call__``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        linearizer, point = self._linearizer, TickPoint(self.x, r, self.p)
        begins, control = self.ticks == 0, copied(self._control)
        try:
            x, slope = linearizer.differentiated(point, control, True, begins)
        except NotDifferentiable:
            if self._side is None:
                raise
            slope = linearizer.one_sided(point, self._control, begins, self._side)
            control = copied(self._control)
            x = linearizer.after(point, control)
        self._control = control
        self.go_on(x, 1)
        return slope


def columns_of_one(
    linearizer: TickDerivatives, arms: Arms, arm: int, side: int | None
) -> Iterator[Array]:
    """Columns after each tick of one arm."""
    motion, moved = Motion(linearizer, arms.x[arm], arms.p[arm], side), arms.initial[arm]
    tau, held, nx = arms.tau[arm], arms.held[arm], len(moved)
    while (k := motion.ticks) < len(tau):
        most = min(STRETCH, linearizer.nonsmooth.ticks_before(motion.x, tau[k:]))
        if (event_free := linearizer.event_free) and most:
            ahead = slice(k, k + most)
            part = Arms(motion.x[None], tau[None, ahead], arms.p[arm][None],
                        np.ascontiguousarray(moved)[None], held[None, ahead])  # fmt: skip
            columns, _, after, (ticks,) = event_free.columns(part, True, 1, 1, begins=k == 0)
            yield from columns[0, :ticks]
            motion.go_on(after[0], int(ticks))
            if ticks:
                moved = columns[0, ticks - 1]
            if ticks == most:
                continue
        slope = motion.slope(tau[k := motion.ticks])
        moved = slope[:, :nx] @ moved + slope[:, nx:] @ held[k]
        yield moved


def copied(control: SubstepControl | None) -> SubstepControl | None:
    """The state of an error control, for a tick that is only tried."""
    return control and control.copy()


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
