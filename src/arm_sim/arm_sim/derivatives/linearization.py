# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of ticks, across the events in them.

Smooth motion is differentiated in compiled code (``tangents``): the derivative is that of the step
that is integrated. Where an event ends a motion, its instant depends on the state: with a guard g
that is zero there, and the step Φ of length h, the instant changes by
dh = −(g_x Φ_x dx)/(g_x Φ_h), the state by Φ_x dx + Φ_h dh, an impact by its own derivative, and
the remaining tick is shorter by dh. Together these are the saltation matrix (Leine, Nijmeijer,
Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, chapter 7; Kong, Payne, Zhu,
Johnson, "Saltation matrices: the essential tool for linearizing hybrid dynamical systems",
Proc. IEEE 112, 2024), of the method's step instead of the exact motion.
"""

from __future__ import annotations

import logging
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
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.derivatives.events import Events, acting, diverged
from arm_sim.derivatives.nonsmooth_points import NonsmoothPoints, sided
from arm_sim.derivatives.one_sided import TickPoint, one_sided
from arm_sim.derivatives.python_linearize import Linearize, python_linearize
from arm_sim.derivatives.tangents import Arms, Tangents
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.integrators.methods import build_attempt
from arm_sim.integrators.response import rate_by_state
from arm_sim.integrators.selection import Choice, fastest_rate
from arm_sim.integrators.stability import misses
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import scaled_jacobian
from arm_sim.stepping.adaptive import SubstepControl, controlled_tick, within_reach
from arm_sim.stepping.python_step import unanswered
from arm_sim.stepping.rollout import Engine, alike, natural_width, repeated, widths
from arm_sim.stepping.stepper import Stepper

# Ticks without events that are differentiated at a time.
STRETCH = 64
_log = logging.getLogger(__name__)
UNSETTLED = "the derivatives of a step do not settle as it is divided"


@sealed
class Linearizer:
    """Derivatives of a scene's ticks by state and command, and by some of its tunable quantities.

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
        self._rate = rate_by_state(plant) if _warn_of_coarse_steps(plant, choice) else None
        self._of_smoothed = dict[float, Tangents]()

    def __call__(self, x: Array, r: Array, ticks: int, side: int | None = None) -> Array:
        """Differentiate ``ticks`` ticks from ``x`` under the held command ``r``.

        Args:
            x: State, shape (nx,).
            r: Command, shape (n,).
            ticks: Number of ticks.
            side: See ``motion``.

        Returns:
            Derivatives by state, command and quantities side by side, shape (nx, nx + n + nt).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        slope: Array = self.many(x[None], r[None], ticks, threads=1, lanes=1, side=side)[0]
        return slope

    def many(
        self,
        x: Array,
        r: Array,
        ticks: int,
        threads: int | None,
        lanes: int | None,
        side: int | None = None,
    ) -> Array:
        """Differentiate ticks of many arms.

        Args:
            x: States, shape (b, nx).
            r: Commands, shape (b, n).
            ticks: Number of ticks.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            side: See ``motion``.

        Returns:
            As of one, for each arm, shape (b, nx, nx + n + nt).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        nx, p = self._plant.nx, self._stepper.p
        if self._rate and _warn_of_misses(self._plant, self._choice, max(map(self._rate, x))):
            self._rate = None
        if fast := self._compiled:
            _, slopes, alone = fast.slopes(x, r, p, ticks, threads, lanes)
            alone = self._one_by_one(alone, x, r[:, None], ticks)
        else:
            widths(lanes)  # which checks them
            slopes, alone = np.empty((len(x), nx, nx + self._held)), list(range(len(x)))
        if alone and ticks > 1:
            arms = self._unit_columns(x, r, p, ticks)
        for arm in alone:
            with _naming(arm, len(x)):
                if ticks == 1:
                    slopes[arm] = self.motion(x[arm], p, side).slope(r[arm])
                else:
                    *_, slopes[arm] = self._alone(arms, arm, side)
        return slopes

    def along(self, x: Array, r: Array, threads: int | None) -> Array:
        """Derivatives of ticks of one motion, each from a state in which the one before ends.

        Ticks that have no derivative because they begin or end on the boundary of a mode, such as
        one in which a joint breaks away, are given that of the motion's own modes: the one-sided
        derivative in the direction in which the arm moves.

        Args:
            x: States, shape (b, nx).
            r: Commands, shape (b, n).
            threads: Cores to use; None for all that the work is worth.

        Returns:
            As ``many``.

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If there is no such derivative either, as where a motion grazes.
        """
        if not (fast := self._compiled):
            return self.many(x, r, 1, threads, None)
        p = self._stepper.p
        _, slopes, alone = fast.slopes(x, r, p, 1, threads, None, begins=False)
        for arm in self._one_by_one(alone, x, r[:, None], 1):
            place = TickPoint(x[arm], r[arm], p)
            with _naming(arm, len(x)):
                slopes[arm] = self.either(place, self.control(), begins=False)
        return slopes

    def smoothed(self, x: Array, r: Array, speed: float, threads: int | None) -> Array:
        """As ``along``, of the arm with smooth friction and without stops: ``Options``.

        Raises:
            CompilerMissing: Without compiled code.
        """
        if speed not in self._of_smoothed:
            plant = self._plant.variant(stops=False, sliding=True, regularization=speed)
            self._of_smoothed[speed] = Tangents(plant, self._choice, self._backend, self._tuned)
        if not (fast := self._of_smoothed[speed]).native:
            raise CompilerMissing(f"smooth derivatives need compiled code: {HOW_TO_GET_CODE}")
        _, slopes, _ = fast.slopes(x, r, self._stepper.p, 1, threads, None)
        return slopes

    def _unit_columns(self, x: Array, r: Array, p: Array, ticks: int) -> Arms:
        """Arms with the columns of a unit matrix, under held commands."""
        arms, nx, unit = len(x), self._plant.nx, np.eye(self._plant.nx + self._held)
        held = repeated(unit[None, None, nx:], (arms, ticks, self._held, len(unit)))
        given = repeated(unit[None, :nx], (arms, nx, len(unit)))
        commands = repeated(r[:, None], (arms, ticks, r.shape[1]))
        return Arms(x, commands, repeated(p[None], (arms, len(p))), given, held)

    def prepare(self) -> None:
        """Compile what ticks need, unless that is done."""
        if self.event_free is not self._compiled:
            self._smooth.library(natural_width())
        (self._compiled or self._smooth).library(1)
        self.prepare_events()

    def prepare_events(self) -> None:
        """Compile what ticks with events need, unless that is done or there are none."""
        if self._eventful:
            _ = self._events

    def product(
        self, x: Array, r: Array, ticks: int, dx: Array, dr: Array, side: int | None = None
    ) -> Array:
        """Derivatives by state and command of ticks of one arm, times a column, shape (nx,).

        Args:
            x: State, shape (nx,).
            r: Command, held, shape (n,).
            ticks: Number of ticks.
            dx: Change of the state, shape (nx,).
            dr: Change of the command, shape (n,).
            side: See ``motion``.

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        dx, dr = np.ascontiguousarray(dx), np.ascontiguousarray(dr)
        held = repeated(dr[None, None, :, None], (1, ticks, len(dr), 1))
        tau = repeated(r[None, None], (1, ticks, len(r)))
        arm = Arms(x[None], tau, self._stepper.p[None], dx[None, :, None], held)
        product: Array = self.carried(arm, threads=1, lanes=1, side=side)[0, 0, :, 0]
        return product

    def carried(
        self,
        arms: Arms,
        threads: int | None,
        lanes: int | None,
        every: bool = False,
        side: int | None = None,
    ) -> Array:
        """Products of derivatives of ticks with columns, for many arms.

        Args:
            arms: Where they begin, and the columns.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            every: Whether to return the columns after every tick, not only after the last.
            side: See ``motion``.

        Returns:
            Columns of the states, shape (b, ticks, nx, k), or (b, 1, nx, k).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
            NotDifferentiable: If a tick has no derivative.
        """
        if fast := self._compiled:
            columns, alone, *_ = fast.columns(arms, every, threads, lanes)
            alone = self._one_by_one(alone, arms.x, arms.tau, arms.ticks)
        else:
            widths(lanes)  # which checks them
            columns, alone = arms.room(every), list(range(arms.count))
        for arm in alone:
            with _naming(arm, arms.count):
                for k, each in enumerate(self._alone(arms, arm, side)):
                    columns[arm, k if every else 0] = each
        return columns

    @cached_property
    def _compiled(self) -> Tangents | None:
        """Compiled code for ticks away from stops, or of a scene with events without any."""
        if alike(self._plant, self._choice) and self._smooth.native:
            return self._smooth
        return self.event_free

    @cached_property
    def event_free(self) -> Tangents | None:
        """Compiled code for ticks without events of a scene with events."""
        native = self.engine and self._backend != "vm" and self._tangents.native
        return self._tangents if native else None

    @cached_property
    def _smooth(self) -> Tangents:
        """Of an arm away from its stops."""
        if self._plant.free is None:
            return self._tangents
        return Tangents(self._plant.free, self._choice, self._backend, self._tuned)

    @built_once
    def _tangents(self) -> Tangents:
        return Tangents(self._plant, self._choice, self._backend, self._tuned, self.engine)

    @cached_property
    def engine(self) -> Engine | None:
        """What finds the modes of ticks of fixed length in a scene with events."""
        watched = self._eventful and self._choice.tolerance is None
        return Engine.of(self._stepper) if watched else None

    def _one_by_one(self, alone: list[int], x: Array, r: Array, ticks: int) -> list[int]:
        """Arms to be differentiated alone: those, and those with a kink, now or later."""
        if self.event_free and self.nonsmooth.of_states and ticks > 1:
            return list(range(len(x)))
        return sorted({*alone, *self.nonsmooth.arms(x, r)})

    @cached_property
    def one(self) -> Linearize:
        """Derivatives of one tick for Python, see ``python_linearize``."""
        fast = None if self._rate or self._tuned else self._compiled
        if fast is None:
            return unanswered
        return python_linearize(fast, self._plant, self._stepper.p, self._choice.dt)

    def motion(self, x: Array, p: Array, side: int | None = None) -> Motion:
        """A motion from a state, to be differentiated tick by tick through its events.

        Args:
            x: State at the beginning, shape (nx,).
            p: Tunable numbers, shape (np,).
            side: 1 or -1: ticks without a derivative are given their one-sided derivatives, see
                ``one_sided``; None: they are refused.
        """
        return Motion(self, x, p, side)

    def _alone(self, arms: Arms, arm: int, side: int | None) -> Iterator[Array]:
        """Columns after each tick of one arm."""
        motion, moved = self.motion(arms.x[arm], arms.p[arm], side), arms.given[arm]
        tau, pushed, nx = arms.tau[arm], arms.pushed[arm], self._plant.nx
        while (k := motion.ticks) < len(tau):
            most = min(STRETCH, self.nonsmooth.ticks_before(motion.x, tau[k:]))
            if self.event_free and most:
                ahead = slice(k, k + most)
                part = Arms(motion.x[None], tau[None, ahead], arms.p[arm][None],
                            np.ascontiguousarray(moved)[None], pushed[None, ahead])  # fmt: skip
                columns, _, after, done = self.event_free.columns(part, True, 1, 1, begins=k == 0)
                yield from columns[0, : done[0]]
                motion.go_on(after[0], int(done[0]))
                if done[0]:
                    moved = columns[0, done[0] - 1]
                if done[0] == most:
                    continue
            slope = motion.slope(tau[k := motion.ticks])
            moved = slope[:, :nx] @ moved + slope[:, nx:] @ pushed[k]
            yield moved

    def differentiated(
        self, place: TickPoint, control: SubstepControl | None, strict: bool, begins: bool
    ) -> tuple[Array, Array]:
        """State after one tick, and its derivatives by state, command and quantities.

        Args:
            place: State, command and parameters.
            control: State of the error control, which the tick changes.
            strict: Whether to refuse a tick that begins or ends on the boundary of a mode.
            begins: Whether the state is varied, see ``may_go_on``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        if strict and (why := self.nonsmooth.reason(place.x, place.r)):
            raise NotDifferentiable(f"linearize: {why}")
        fast = None if self._eventful else self._compiled
        if fast:
            x, r = place.x[None], place.r[None]
            after, slopes, lost = fast.slopes(x, r, place.p, 1, 1, 1, begins)
            if not lost:
                return after[0], slopes[0]
        if self._eventful:
            found = self._events.tick(place, control, strict, begins)
        else:
            found = self._smooth_tick(place, control)
        if not np.isfinite(found[1]).all():
            raise NotDifferentiable(f"linearize: {UNSETTLED}{self._choice.remark}")
        return found

    def either(self, place: TickPoint, control: SubstepControl | None, begins: bool) -> Array:
        """Derivatives of one tick; on the boundary between two modes, those of either."""
        try:
            return self.differentiated(place, copied(control), True, begins)[1]
        except NotDifferentiable:
            return self.differentiated(place, copied(control), False, begins)[1]

    def after(self, place: TickPoint, control: SubstepControl | None) -> Array:
        """State after a tick, shape (nx,); the tick changes ``control``."""
        if self._eventful:
            return self._events.after(place, control)
        return self.differentiated(place, control, strict=False, begins=False)[0]

    def control(self) -> SubstepControl | None:
        """State of the error control at the beginning of a motion; None without."""
        choice = self._choice
        if choice.tolerance is None:
            return None
        return SubstepControl(choice.tolerance, choice.method.order)

    def one_sided(
        self, place: TickPoint, control: SubstepControl | None, begins: bool, side: int
    ) -> Array:
        """One-sided derivatives of a tick, see ``one_sided``."""
        return one_sided(
            lambda at: self.after(at, copied(control)),
            lambda at: self.either(at, control, begins),
            place, side, self._tuned, self._entries,
        )  # fmt: skip

    @cached_property
    def _entries(self) -> list[str]:
        """What a tick is differentiated by, for messages."""
        model, laws = self._plant.model, self._plant.laws
        names = [f"the {what} of joint '{name}'" for what in ("position", "velocity")
                 for name in model.joint_names]  # fmt: skip
        names += [f"the {name}" for name in (laws.names if laws else ())]
        names += [f"the command of joint '{name}'" for name in model.joint_names]
        return names + [f"parameter {k}" for k in self._tuned]

    @property
    def _eventful(self) -> bool:
        return self._plant.eventful and self._stepper.kernel.native

    @built_once
    def _events(self) -> Events:
        engine = self._stepper.compiled
        assert engine is not None
        return Events(self._plant, self._choice, engine, self._tangents, self._tuned)

    def _smooth_tick(
        self, place: TickPoint, control: SubstepControl | None
    ) -> tuple[Array, Array]:
        """State after a tick without events, step by step, and its derivatives."""
        x, r, p = place.x, place.r, place.p
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
            after, slope = self._tangents.step(after, u, modes, h, np.vstack([slope, held]))
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
        taken, attempt = list[float](), self._attempt.call("attempt")
        if not controlled_tick(attempt, x.copy(), u, p, self._choice.dt, control, taken):
            raise diverged(self._choice)
        return taken

    @built_once
    def _attempt(self) -> Kernel:
        plant, method, n = self._plant, self._choice.method, self._plant.model.n
        more = plant.mechanics.project, partial(scaled_jacobian, plant)
        function = build_attempt(method, plant.rhs, n, plant.laws.scale, *more)
        return Kernel([function], "vm")


class Motion:
    """A motion of one arm that is differentiated tick by tick.

    Args:
        linearizer: Of its ticks.
        x: State at the beginning, shape (nx,).
        p: Tunable numbers.
        side: See ``Linearizer.motion``.

    Attributes:
        x: The state now.
        p: Tunable numbers.
        ticks: Number of ticks that are behind.
    """

    def __init__(self, linearizer: Linearizer, x: Array, p: Array, side: int | None) -> None:
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
        linearizer, place = self._linearizer, TickPoint(self.x, r, self.p)
        begins, control = self.ticks == 0, copied(self._control)
        try:
            x, slope = linearizer.differentiated(place, control, True, begins)
        except NotDifferentiable:
            if self._side is None:
                raise
            slope = linearizer.one_sided(place, self._control, begins, self._side)
            control = copied(self._control)
            x = linearizer.after(place, control)
        self._control = control
        self.go_on(x, 1)
        return slope


def copied(control: SubstepControl | None) -> SubstepControl | None:
    """The state of an error control, for a tick that is only tried."""
    return control and control.copy()


def _warn_of_coarse_steps(plant: Plant, choice: Choice) -> bool:
    """Say that steps of fixed length answer other than the motion does, to small disturbances.

    Returns:
        Whether they may do so in other states, as transmissions stiffen there.
    """
    if choice.tolerance is not None:
        return False
    for joint in np.flatnonzero(sided(plant)):
        _log.warning(
            "derivatives of time steps in which joint '%s' turns back are those of %s, not of the "
            "motion: its viscous friction differs by direction",
            plant.model.joint_names[joint], choice.method.name,
        )  # fmt: skip
    told = _warn_of_misses(plant, choice, fastest_rate(plant))
    couplings = (drive.coupling for drive in plant.model.drives if drive)
    return not told and any(coupling and coupling.stiffening > 0.0 for coupling in couplings)


def _warn_of_misses(plant: Plant, choice: Choice, rate: float) -> bool:
    """Say it of what answers at a rate in [1/s]; return whether that is so."""
    off = misses(choice.method, rate, choice.dt)
    if not off > plant.model.scene.sim.accuracy:
        return False
    _log.warning(
        "derivatives are those of %s in steps of dt = %g s: for what answers in %.2g s they "
        "differ from the motion's by %.1g; a tolerance, or a smaller dt, reduces that",
        choice.method.name, choice.dt, 1.0 / rate, min(off, 1.0),
    )  # fmt: skip
    return True


@contextmanager
def _naming(arm: int, arms: int) -> Iterator[None]:
    """Name the arm in errors, if there are several."""
    try:
        yield
    except (SimulationDiverged, NotDifferentiable) as error:
        if arms > 1:
            raise type(error)(f"arm {arm}: {error}") from None
        raise
