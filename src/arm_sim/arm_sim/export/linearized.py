# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks in C: those without events, as the simulator's compiled code has them."""

from __future__ import annotations

import casadi as ca

from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.columns import column_function
from arm_sim.derivatives.kinks import Kinks
from arm_sim.derivatives.tangents import Tangents
from arm_sim.export.generated import prefixed, static_functions
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.stepping.engine import source
from arm_sim.stepping.rollout import Engine

PREFIX = "slope_"
"""Begins the names of this part of a library."""
_OF_THE_TICK = frozenset({"foreseen.h", "stops.h"})


def derivatives_of_ticks(plant: Plant, choice: Choice, numbers: int) -> str:
    """C source of ``slope_carry_ticks``, see ``tangents.c``, for after the engine of the tick.

    Args:
        plant: The equations.
        choice: Method and tick, without error control.
        numbers: Number of tunable numbers to differentiate by.
    """
    engine = Engine() if plant.eventful else None
    code = Tangents(plant, choice, "auto", tuple(range(numbers)), engine).code
    columns = (compiler.NATIVE / "columns.h").read_text(encoding="utf-8")
    text = "\n".join([
        static_functions(code.functions),
        source(code.defines),
        columns,
        *map(column_function, code.columns),
        source({}, "tangents.c", code.without | _OF_THE_TICK),
    ])  # fmt: skip
    return prefixed(text.replace("\nEXPORTED ", "\nstatic "), PREFIX)


def kinked(plant: Plant) -> ca.Function:
    """(x, command) -> 1 where a tick begins in a kink, else 0."""
    x, r = ca.SX.sym("x", plant.nx), ca.SX.sym("r", plant.model.n)
    return ca.Function("kinked", [x, r], [Kinks(plant).begins_kinked(x, r)], {"cse": True})


def effort_slopes(plant: Plant) -> ca.Function:
    """Derivatives of torques on the joints by the state after a tick, the state, the command.

    Transposed, as function of the state, the command and the state after the tick.
    """
    n = plant.model.n
    x, r, after = (ca.SX.sym(*each) for each in (("x", plant.nx), ("r", n), ("y", plant.nx)))
    u = actuation(plant)(x, r)
    effort = plant.torques(after, u)[0] if plant.torques else u
    parts = [ca.densify(ca.jacobian(effort, by).T) for by in (after, x, r)]
    return ca.Function("effort_slopes", [x, r, after], parts, {"cse": True})
