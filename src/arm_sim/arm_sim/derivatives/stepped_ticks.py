# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks without events, step by step, where no compiled code has them as a whole.

Under error control the steps are those that the simulator takes.
"""

from functools import partial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.derivatives.one_sided import TickPoint
from arm_sim.derivatives.refusals import divergence
from arm_sim.derivatives.tangents import Tangents
from arm_sim.exceptions import NotDifferentiable
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_step
from arm_sim.plant.actuation import actuation_slopes
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import scaled_jacobian
from arm_sim.stepping.adaptive import SubstepControl, adaptive_tick, within_reach
from arm_sim.stepping.stepper import Stepper


class SteppedTicks:
    """Derivatives of ticks without events, by state, command and quantities.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        stepper: Determines the modes of joints and contacts.
        tangents: Derivatives of the scene's steps.
        column_count: Number of columns of derivatives: for state, command and quantities.
    """

    def __init__(
        self, plant: Plant, choice: Choice, stepper: Stepper, tangents: Tangents, column_count: int
    ) -> None:
        self._plant, self._choice, self._stepper = plant, choice, stepper
        self._tangents, self._column_count = tangents, column_count

    def tick(self, point: TickPoint, control: SubstepControl | None) -> tuple[Array, Array]:
        """State after a tick, shape (nx,), and its derivatives, shape (nx, column_count).

        Args:
            point: State, command and parameters.
            control: State of the error control, which the tick changes.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If a joint is at its stop.
        """
        x, r, p = point.x, point.r, point.p
        if self._plant.model.stops.touched(x[: len(r)]).any():
            raise NotDifferentiable(
                f"linearize: a joint is at its stop, which needs compiled code: {HOW_TO_GET_CODE}"
            )
        u, u_x, u_r = (np.array(value) for value in self._actuation(x, r))
        modes, nx = self._stepper.reactions.modes_at(x, u, p).p, self._plant.nx
        columns = self._column_count
        held = np.eye(columns - nx + 1, columns, nx)  # its last row: lengths are constant
        slope, after = np.eye(nx, columns), x
        for h in self._step_lengths(x, u.ravel(), modes, control):
            after, slope = self._tangents.step(after, u, modes, h, np.vstack([slope, held]))
        if not within_reach(after):
            raise divergence(self._choice)
        by_x, by_u, by_p = np.split(slope, (nx, nx + len(r)), axis=1)
        return after, np.hstack([by_x + by_u @ u_x, by_u @ u_r, by_p])

    def _step_lengths(
        self, x: Array, u: Array, p: Array, control: SubstepControl | None
    ) -> list[float]:
        """Lengths of the steps of a tick, which change ``control``."""
        if control is None:
            return [self._choice.dt]
        lengths, attempt = list[float](), self._attempt.call("attempt")
        if not adaptive_tick(attempt, x.copy(), u, p, self._choice.dt, control, lengths):
            raise divergence(self._choice)
        return lengths

    @built_once
    def _actuation(self) -> ca.Function:
        return actuation_slopes(self._plant)

    @built_once
    def _attempt(self) -> Kernel:
        plant, method, n = self._plant, self._choice.method, self._plant.model.n
        project, scaled = plant.mechanics.project, partial(scaled_jacobian, plant)
        function = build_step(
            method, plant.rhs, n, project, scaled, "attempt", scale=plant.laws.scale
        )
        return Kernel([function], "vm")
