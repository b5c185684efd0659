# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of ticks.

CasADi differentiates the very step that is integrated.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import Kernel
from arm_sim.exceptions import SimulationDiverged
from arm_sim.integrators.methods import build_attempt, build_step, build_tick
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import SubstepControl, controlled_tick


class Linearizer:
    """Derivatives of a scene's ticks.

    They are computed on CasADi's virtual machine, since they are seldom asked for in a loop.
    """

    def __init__(self, plant: Plant, choice: Choice) -> None:
        self._plant, self._choice = plant, choice
        n = plant.model.n
        step = build_step(choice.method, plant.rhs, n, plant.project, plant.scaled_jacobian)
        step = plant.contact.closing(step) if plant.contact else step
        tick = build_tick(step, actuation(plant))
        x, r, p, h = (
            ca.MX.sym(name, tick.size1_in(i)) for i, name in enumerate(("x", "r", "p", "h"))
        )
        after = tick(x, r, p, h)[0]
        results = [after, ca.jacobian(after, x), ca.jacobian(after, r)]
        self._derivatives = ca.Function("derivatives", [x, r, p, h], results, {"cse": True})

    def __call__(self, x: Array, r: Array, p: Array, ticks: int) -> tuple[Array, Array]:
        """Differentiate ``ticks`` ticks from ``x`` under the held command ``r``.

        Args:
            x: State, shape (nx,).
            r: Command, shape (n,).
            p: Vector of the plant's functions, modes of joints and contacts included.
            ticks: How many.

        Returns:
            A of shape (nx, nx) and B of shape (nx, n).

        Raises:
            SimulationDiverged: If a tick cannot be computed.
        """
        A, B = np.eye(len(x)), np.zeros((len(x), len(r)))
        for _ in range(ticks):
            for h in self._lengths(x, r, p):
                after, A_h, B_h = (np.array(value) for value in self._derivatives(x, r, p, h))
                x, A, B = after.ravel(), A_h @ A, A_h @ B + B_h
        return A, B

    def _lengths(self, x: Array, r: Array, p: Array) -> list[float]:
        """Lengths of the sub-steps that a tick from ``x`` takes."""
        choice, plant = self._choice, self._plant
        if choice.tolerance is None:
            return [choice.dt]
        scale, project = plant.scale, plant.project
        attempt = build_attempt(
            choice.method, plant.rhs, plant.model.n, scale, project, plant.scaled_jacobian
        )
        kernel = Kernel([attempt], "vm")
        u = np.array(actuation(plant)(x, r)).ravel()
        control, taken = SubstepControl(choice.tolerance, choice.method.order), list[float]()
        if not controlled_tick(kernel.call("attempt"), x.copy(), u, p, choice.dt, control, taken):
            raise SimulationDiverged(f"linearize: the tick cannot be computed{choice.remark}")
        return taken
