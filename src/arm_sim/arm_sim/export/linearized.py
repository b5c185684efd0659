# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks in C: those without events, as the simulator's compiled code has them."""

from __future__ import annotations

import casadi as ca

from arm_sim.derivatives.tangents import TangentCode, tangents_source
from arm_sim.export.amalgamated import amalgamated
from arm_sim.export.generated import prefixed
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant

_UNITS = '#include "derivatives/tangent_ticks.c"\n#include "derivatives/tick_derivative.c"\n'
PREFIX = "slope_"
"""Begins the names of this part of a library."""


def derivatives_of_ticks(code: TangentCode, done: set[str]) -> str:
    """C of ``slope_differentiate_tick``, see ``tick_derivative.c``, for after the tick's engine.

    Args:
        code: The functions.
        done: Files of which that engine is made.
    """
    written = tangents_source(code.columns, "static const")
    text = amalgamated(f"{written}{_UNITS}", done)
    return prefixed(text, PREFIX)


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
