# SPDX-License-Identifier: Apache-2.0
"""Derivatives of single ticks: compiled, through events, or step by step."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.one_at_a_time import built_once, one_at_a_time
from arm_sim.derivatives.eventful_ticks import EventfulTicks
from arm_sim.derivatives.nonsmooth_points import NonsmoothPoints
from arm_sim.derivatives.one_sided import TickPoint, one_sided
from arm_sim.derivatives.stepped_ticks import SteppedTicks
from arm_sim.derivatives.tangents.compiled_tangents import CompiledTangents
from arm_sim.exceptions import NotDifferentiable
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import SubstepControl, copy_of
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
        p_indices: Indices in p of the quantities to differentiate by.

    Attributes:
        compiled: Compiled derivatives.
        nonsmooth: Lasting kinks.
    """

    @one_at_a_time
    def __init__(
        self, plant: Plant, choice: Choice, stepper: Stepper, backend: str,
        p_indices: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self._p_indices = p_indices
        self.compiled = CompiledTangents(plant, choice, stepper, backend, p_indices)
        self.nonsmooth = NonsmoothPoints(plant)

    @property
    def column_count(self) -> int:
        """Number of columns: for state, command and quantities."""
        return self._plant.nx + self._plant.model.n + len(self._p_indices)

    def prepare_events(self) -> None:
        """Compile what ticks with events need, unless that is done or there are none."""
        if self.compiled.eventful:
            _ = self._eventful

    def differentiate(
        self, point: TickPoint, control: SubstepControl | None, *, strict: bool, is_first: bool
    ) -> tuple[Array, Array]:
        """State after one tick, and its derivatives by state, command and quantities.

        Args:
            point: State, command and parameters.
            control: State of the error control, which the tick changes.
            strict: Whether to refuse a tick that begins or ends on the boundary of a mode.
            is_first: Whether it is the first tick of a motion, see ``is_unstable_at_rest``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        if strict and (reason := self.nonsmooth.reason(point.x, point.r)):
            raise NotDifferentiable(f"linearize: {reason}")
        smooth = None if self.compiled.eventful else self.compiled.smooth_ticks
        if smooth:
            x, r = point.x[None], point.r[None]
            after, slopes, invalid = smooth.differentiate(
                x, r, point.p, ticks=1, threads=1, lanes=1, is_first=is_first
            )
            if not invalid:
                return after[0], slopes[0]
        if self.compiled.eventful:
            state, slope = self._eventful.tick(point, control, strict=strict, is_first=is_first)
        else:
            state, slope = self._stepped.tick(point, control)
        if not np.isfinite(slope).all():
            raise NotDifferentiable(f"linearize: {UNSETTLED}{self._choice.remark}")
        return state, slope

    def differentiate_either_side(
        self, point: TickPoint, control: SubstepControl | None, is_first: bool
    ) -> Array:
        """Derivatives of one tick; on the boundary between two modes, those of either."""
        try:
            return self.differentiate(point, copy_of(control), strict=True, is_first=is_first)[1]
        except NotDifferentiable:
            return self.differentiate(point, copy_of(control), strict=False, is_first=is_first)[1]

    def advance(self, point: TickPoint, control: SubstepControl | None) -> Array:
        """State after a tick, shape (nx,); the tick changes ``control``."""
        if self.compiled.eventful:
            return self._eventful.advance(point, control)
        return self.differentiate(point, control, strict=False, is_first=False)[0]

    def new_control(self) -> SubstepControl | None:
        """State of the error control at the beginning of a motion; None without."""
        order, tolerance = self._choice.method.order, self._choice.tolerance
        return None if tolerance is None else SubstepControl(tolerance, order)

    def differentiate_one_side(
        self, point: TickPoint, control: SubstepControl | None, is_first: bool, side: int
    ) -> Array:
        """One-sided derivatives of a tick, see ``one_sided``."""
        return one_sided(
            lambda place: self.advance(place, copy_of(control)),
            lambda place: self.differentiate_either_side(place, control, is_first),
            point, side, self._p_indices, self._entries,
        )  # fmt: skip

    @cached_property
    def _entries(self) -> list[str]:
        """What a tick is differentiated by, for messages."""
        model, laws = self._plant.model, self._plant.laws
        names = [f"the {quantity} of joint '{name}'" for quantity in ("position", "velocity")
                 for name in model.joint_names]  # fmt: skip
        names += [f"the {name}" for name in (laws.names if laws else ())]
        names += [f"the command of joint '{name}'" for name in model.joint_names]
        return names + [f"parameter {k}" for k in self._p_indices]

    @built_once
    def _eventful(self) -> EventfulTicks:
        engine = self._stepper.compiled
        assert engine is not None
        return EventfulTicks(
            self._plant, self._choice, engine, self.compiled.of_scene, self._p_indices
        )

    @cached_property
    def _stepped(self) -> SteppedTicks:
        of_scene = self.compiled.of_scene
        return SteppedTicks(self._plant, self._choice, self._stepper, of_scene, self.column_count)
