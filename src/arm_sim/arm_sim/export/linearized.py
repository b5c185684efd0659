# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks in C: those without events, as the simulator's compiled code has them."""

import casadi as ca

from arm_sim.derivatives.tangents import TangentFunctions, tangents_source
from arm_sim.export.amalgamated import amalgamated
from arm_sim.export.generated import prefixed
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import dense_function

_UNITS = '#include "derivatives/tangent_ticks.c"\n#include "derivatives/tick_derivative.c"\n'
# Begins the names of this part of a library
PREFIX = "slope_"


def derivatives_of_ticks(functions: TangentFunctions, included: set[str]) -> str:
    """C of ``slope_differentiate_tick``, see ``tick_derivative.c``, for after the tick's engine.

    Args:
        functions: Those of tangents.
        included: Files of which that engine is made.
    """
    text = tangents_source(functions.of_columns, "static const") + _UNITS
    return prefixed(amalgamated(text, included), PREFIX)


def effort_slopes(plant: Plant, tunable: int) -> ca.Function:
    """Derivatives of torques on the joints by state, command and tunable numbers.

    As function of the state, the command, the state after the tick and its derivatives; the latter
    and the result are transposed, as C stores them by rows.
    """
    n, nx = plant.model.n, plant.nx
    x, r, after = (ca.SX.sym(*size) for size in (("x", nx), ("r", n), ("y", nx)))
    of_after = ca.SX.sym("slopes", nx + n + tunable, nx)
    u = actuation(plant)(x, r)
    effort = plant.torques(after, u)[0] if plant.torques else u
    by_after, by_state, by_command = (ca.jacobian(effort, by).T for by in (after, x, r))
    direct = ca.vertcat(by_state, by_command, ca.SX(tunable, n))
    slopes = ca.mtimes(of_after, by_after) + direct
    return dense_function("effort_slopes", [x, r, after, of_after], slopes)
