# SPDX-License-Identifier: Apache-2.0
"""The functions of a scene that a compiled tick evaluates."""

from functools import partial

import casadi as ca

from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_step
from arm_sim.plant.plant import Plant, slope_of_loads
from arm_sim.plant.slopes import scaled_jacobian

# Prefix of the functions for joints away from their stops
FREE = "free_"
# Prefix of the functions for joints that all slide, without contact
MOVING = "moving_"


def tick_functions(
    plant: Plant, choice: Choice, actuate: ca.Function
) -> tuple[list[ca.Function], ca.Function]:
    """The functions that a tick evaluates, and that of them which advances without events."""
    smooth = smooth_motion(plant, choice)
    functions = [slope_of_loads(plant), smooth, actuate, *plant.events.values()]
    if plant.free:
        smooth = smooth_motion(plant.free, choice, FREE)
        rhs, arguments = plant.free.rhs, plant.free.rhs.mx_in()  # under a name of its own
        functions += [ca.Function(f"{FREE}rhs", arguments, rhs.call(arguments)), smooth]
    if plant.has_sliding_modes:
        functions.append(smooth_motion(plant.variant(sliding=True), choice, MOVING))
    return functions, smooth


def smooth_motion(plant: Plant, choice: Choice, prefix: str = "") -> ca.Function:
    """A step of fixed length or, with error control, an attempt; ``prefix`` begins its name.

    In a scene with events it returns its continuous output, too, and begins with the slope that
    is known from the choice of modes.
    """
    controlled = choice.tolerance is not None
    return build_step(
        choice.method, plant.rhs, plant.model.n, project=plant.mechanics.project,
        scaled=partial(scaled_jacobian, plant), scale=plant.laws.scale if controlled else None,
        name=prefix + ("attempt" if controlled else "step"), dense=plant.eventful,
        loads=plant.events.get("loads"),
    )  # fmt: skip
