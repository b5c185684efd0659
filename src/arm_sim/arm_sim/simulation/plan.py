# SPDX-License-Identifier: Apache-2.0
"""The plan of a tick: the parts it computes and skips, and their cost."""

import time
from functools import cached_property
from textwrap import fill

import numpy as np

from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.kernel import operations
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.simulation.law_cost import LawCost, measure_law
from arm_sim.simulation.parts import parts_of
from arm_sim.stepping.stepper import Stepper

TICKS = 200  # in one run
RUNS = 5  # of which the fastest counts


@sealed
class Plan:
    """Parts that are computed and skipped.

    Attributes:
        parts: The physics, computed and skipped, and why.
        operations: Arithmetic operations of one tick (of one sub-step with error control).
        apart: Operations of a tick (or sub-step) in which all joints move and nothing touches.
        evaluation: Operations of one evaluation of the acceleration.
        algorithm: How accelerations are computed.
        integrator: Name of the method.
        reason: Why this method was selected.
        backend: What executes the code.
    """

    def __init__(self, plant: Plant, choice: Choice, stepper: Stepper) -> None:
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self.parts = parts_of(plant)
        self.operations, self.apart = stepper.tick_operations, stepper.moving_operations
        mechanics = (plant.free or plant).mechanics
        self.evaluation, self.algorithm = operations(mechanics.acceleration), mechanics.method
        self.integrator = choice.method.name
        self.reason = choice.reason
        self.backend = stepper.kernel.backend

    @cached_property
    def nanoseconds(self) -> float:
        """Time of one tick in [ns], measured now.

        The minimum of several runs from the initial state without torque.
        """
        model, nx = self._plant.model, self._plant.nx
        trace, effort = np.empty((TICKS, nx)), np.empty((TICKS, model.n))
        notes, fastest = np.empty((TICKS, 2)), np.inf
        for _ in range(RUNS):
            self._stepper.restart()
            x = np.concatenate([model.q0, model.v0, self._plant.laws.initial(model.q0, model.v0)])
            start = time.perf_counter_ns()
            ticks = self._stepper.advance(x, np.zeros(model.n), trace, effort, notes)
            fastest = min(fastest, (time.perf_counter_ns() - start) / max(1, ticks))
        self._stepper.restart()
        return fastest

    @cached_property
    def laws(self) -> tuple[LawCost, ...]:
        """States and measured cost of each law that has states or replaces the command."""
        backend = "auto" if self._stepper.kernel.native else "vm"
        n, laws = self._plant.model.n, self._plant.laws.laws
        return tuple(measure_law(law, n, backend) for law in laws)

    def __repr__(self) -> str:
        """Readable lines."""
        choice = self._choice
        control = "" if choice.tolerance is None else f", tolerance {choice.tolerance:g}"
        per = "sub-step" if choice.tolerance is not None else "time step"
        method = f"{self.integrator} (order {choice.method.order}), dt {choice.dt:g} s{control}"
        free = f" ({self.apart} in free motion)" if self.apart < self.operations else ""
        cost = f"{self.operations} operations per {per}{free}, {self.evaluation} per evaluation"
        lines = [
            f"integrator  {method}: {self.reason}",
            f"accuracy    {self._plant.model.scene.sim.accuracy:g} of 1 + |x|, for each second",
            f"algorithm   {self.algorithm}",
            f"runs on     {self.backend}",
            f"cost        {cost}",
        ]
        lines += [f"            {law}" for law in self.laws]
        lines += [f"computed    {part.name}: {part.why}" for part in self.parts if part.on]
        skipped_parts = ", ".join(part.name for part in self.parts if not part.on) or "none"
        skipped = f"skipped     {skipped_parts}; plan.parts says why"
        lines.append(fill(skipped, 98, subsequent_indent=" " * 12))
        return "\n".join(lines)
