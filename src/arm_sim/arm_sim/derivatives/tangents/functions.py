# SPDX-License-Identifier: Apache-2.0
"""All functions by which tangents of a scene are propagated, and the C of them."""

from collections.abc import Sequence

import casadi as ca

from arm_dynamics.codegen.columns import column_function
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import operations
from arm_sim.derivatives.nonsmooth_points import NonsmoothPoints
from arm_sim.derivatives.tangents.event_free_ticks import EventFreeTick
from arm_sim.derivatives.tangents.step_tangent import StepTangent, command_tangent
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.engine import NATIVE
from arm_sim.stepping.rollouts.lanes import lanes_source
from arm_sim.stepping.tick_functions import MOVING

# Largest number of operations of a step with its derivative that is compiled, in some ten seconds:
# an implicit method needs 520 000 for seven joints.
MAX_OPERATIONS = 600_000
# Name of the structure of functions of columns in generated code
TANGENTS = "own_tangents"
_MEMBERS = Header(NATIVE / "derivatives/tangents.h", only="tangents_t").fields("tangents_t")


class TangentFunctions:
    """Functions of states and of columns.

    A column is a change in one direction, with an entry for each of x, u, the quantities, and h.

    Args:
        plant: The equations.
        choice: Method and tick.
        p_indices: Indices in p of the quantities to differentiate by.
        ticks: Whether ticks without events of a scene with events are differentiated.

    Attributes:
        step: Functions of the step.
        event_free: Functions of ticks without events, if these are differentiated.
    """

    def __init__(
        self, plant: Plant, choice: Choice, p_indices: Sequence[int], ticks: bool
    ) -> None:
        self._plant, self._choice, self._quantities = plant, choice, len(p_indices)
        self.event_free = EventFreeTick.of(plant) if ticks else None
        self.step = StepTangent(plant, choice, p_indices, dense=ticks)
        self._sliding: StepTangent | None = None
        if ticks and (plant.layout.directions or plant.mechanics.contact):
            sliding = plant.variant(sliding=True)
            self._sliding = StepTangent(sliding, choice, p_indices, MOVING, dense=True)
        self._acting, self._command = command_tangent(plant)

    @property
    def may_be_compiled(self) -> bool:
        """Whether compilation takes seconds at most."""
        return operations(self.step.advance) <= MAX_OPERATIONS

    @property
    def _steps(self) -> list[StepTangent]:
        return [step for step in (self.step, self._sliding) if step]

    @property
    def of_states(self) -> tuple[ca.Function, ...]:
        """Functions of states."""
        steps = (step.advance for step in self._steps)
        event_free = self.event_free.functions if self.event_free else ()
        return (self._acting, NonsmoothPoints(self._plant).nonsmooth, *steps, *event_free)

    @property
    def of_columns(self) -> tuple[ca.Function, ...]:
        """Functions of columns, without ``propagate``."""
        columns = [self._command, *(step.jvp for step in self._steps)]
        if self.event_free or not self._plant.eventful:
            columns += [vjp for step in self._steps for vjp in step.vjp(self._command)]
        return (*columns, *(self.event_free.columns if self.event_free else ()))

    @property
    def members(self) -> dict[str, int]:
        """Members of the compiled scene besides those that follow from its equations."""
        return (self.event_free.members if self.event_free else {}) | {
            "nstep": max(step.advance.size1_out(1) for step in self._steps),
            "na": self._acting.size1_out(1),
            "nt": self._quantities,
            "has_dense_derivative": int(self.step.advance.n_out() > 2),
        }

    def source(self, lanes: int) -> str:
        """C of the scene and its tangents, for ``lanes`` arms side by side."""
        columns = (*self.of_columns, *([self.step.propagate] if lanes == 1 else []))
        scene = lanes_source(self._plant, self._choice, self.of_states, lanes, self.members)
        return f"{scene}{tangents_source(columns)}"


def tangents_source(columns: Sequence[ca.Function], storage: str = "EXPORTED const") -> str:
    """C of functions of columns, and of the structure ``tangents_t`` of them."""
    names = {function.name() for function in columns}
    members = "".join(f"  {name if name in names else 0},\n" for name, _ in _MEMBERS)
    return "\n".join([
        '#include "derivatives/tangents.h"', *map(column_function, columns),
        f"{storage} tangents_t {TANGENTS} = {{\n{members}}};\n",
    ])  # fmt: skip
