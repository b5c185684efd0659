# SPDX-License-Identifier: Apache-2.0
"""Derivatives of single ticks: compiled, through events, or step by step."""

from collections.abc import Sequence
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
from arm_sim.derivatives.tangents.compiled_tangents import CompiledTangents
from arm_sim.exceptions import NotDifferentiable
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_step
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import scaled_jacobian
from arm_sim.stepping.adaptive import SubstepControl, adaptive_tick, within_reach
from arm_sim.stepping.stepper import Stepper

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

    Attributes:
        compiled: Compiled derivatives.
        nonsmooth: Lasting kinks.
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
        self._plant, self._choice, self._stepper, self._tuned = plant, choice, stepper, tuned
        self.compiled = CompiledTangents(plant, choice, stepper, backend, tuned)
        self.nonsmooth = NonsmoothPoints(plant)

    @property
    def held(self) -> int:
        """Number of commands and quantities, whose columns follow those for the state."""
        return self._plant.model.n + len(self._tuned)

    def prepare_events(self) -> None:
        """Compile what ticks with events need, unless that is done or there are none."""
        if self.compiled.eventful:
            _ = self._events

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
        smooth = None if self.compiled.eventful else self.compiled.smooth_ticks
        if smooth:
            x, r = point.x[None], point.r[None]
            after, slopes, invalid = smooth.slopes(x, r, point.p, 1, 1, 1, begins)
            if not invalid:
                return after[0], slopes[0]
        if self.compiled.eventful:
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
        if self.compiled.eventful:
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

    @built_once
    def _events(self) -> EventfulTicks:
        engine = self._stepper.compiled
        assert engine is not None
        return EventfulTicks(
            self._plant, self._choice, engine, self.compiled.of_scene, self._tuned
        )

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
        modes, nx = self._stepper.reactions.modes_at(x, u, p).p, self._plant.nx
        held = np.eye(self.held + 1, nx + self.held, nx)  # lengths are constant
        slope, after = np.eye(nx, nx + self.held), x
        for h in self._lengths(x, u.ravel(), modes, control):
            columns = np.vstack([slope, held])
            after, slope = self.compiled.of_scene.step(after, u, modes, h, columns)
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
        if not adaptive_tick(attempt, x.copy(), u, p, self._choice.dt, control, lengths):
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


def copied(control: SubstepControl | None) -> SubstepControl | None:
    """The state of an error control, for a tick that is only tried."""
    return control and control.copy()
