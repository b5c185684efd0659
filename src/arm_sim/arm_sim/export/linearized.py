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
from arm_sim.plant.plant import Plant
from arm_sim.stepping.rollout import Engine
from arm_sim.stepping.stepper import source

PREFIX = "slope_"
"""Begins the names of this part of a library."""
_OF_THE_TICK = frozenset({"foreseen.h", "stops.h"})


def derivatives_of_ticks(plant: Plant, choice: Choice) -> str:
    """C source of ``slope_carry_ticks``, see ``tangents.c``, for after the engine of the tick.

    Args:
        plant: The equations.
        choice: Method and tick, without error control.
    """
    code = Tangents(plant, choice, "auto", engine=Engine() if plant.eventful else None).code
    columns = (compiler.NATIVE / "columns.h").read_text()
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
