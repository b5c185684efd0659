# SPDX-License-Identifier: Apache-2.0
"""Code by which arms are advanced side by side, one in each lane of a vector register."""

import ctypes
import re
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import casadi as ca

from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import generate
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.steps import build_tick
from arm_sim.plant.actuation import CompiledControl, actuation
from arm_sim.plant.plant import Plant, slope_of_loads
from arm_sim.stepping.engine import INCLUDED, Compiled, lane_header, library
from arm_sim.stepping.scene_source import scene_source
from arm_sim.stepping.tick_functions import MOVING, smooth_motion

ADDRESS, NUMBER = ctypes.c_void_p, ctypes.c_longlong
# Functions of events that ticks without events need as well, see native/lanes/eventful_ticks.h.
PREDICTED = ("loads", "contact_geometry", "contact_mobility", "contact_close")
# How CasADi writes choices; C++ has no such operator for many arms at a time.
_SIGN = "x<0 ? -1 : x>0 ? 1 : x"
_CHOICE = re.compile(r"\((\w+)\?(\w+):0\)")


def ticks_of_lanes(
    plant: Plant, choice: Choice, width: int, control: CompiledControl | None = None
) -> str:
    """C of ticks of arms side by side, and of what lanes need where there are events.

    Under error control without events, it is that of attempts at sub-steps.

    Args:
        plant: Their equations, away from stops where these are all that causes events.
        choice: Method and tick.
        width: Number of arms.
        control: Controller to compile in, if any.
    """
    inputs = {} if control is None else {"nr": control.law.size1_in(1)}
    functions = [smooth_motion(plant, choice), actuation(plant, control)]
    if plant.eventful:
        events = [function for name, function in plant.events.items() if name in PREDICTED]
        functions = [slope_of_loads(plant), *functions, *events]
        if plant.has_sliding_modes:
            functions.append(smooth_motion(plant.variant(sliding=True), choice, MOVING))
    elif choice.tolerance is None:
        functions = [build_tick(*functions)]
    return lanes_source(plant, choice, functions, width, inputs)


def lanes_source(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], width: int,
    more: Mapping[str, int] = MappingProxyType({}),
) -> str:  # fmt: skip
    """C of functions and of their scene, see ``scene_source``, for ``width`` arms side by side."""
    code = generate(functions)
    if width > 1:
        code = _CHOICE.sub(r"if_else_zero(\1,\2)", code).replace(_SIGN, "sign(x)")
    return f"{lane_header(width)}{code}{scene_source(plant, choice, functions, more=more)}"


@one_at_a_time
def compile_lanes(
    write: Callable[[int], str], width: int, name: str, types: Sequence[type],
    units: tuple[str, ...] = (), folders: tuple[str, ...] = (),
) -> Compiled | None:  # fmt: skip
    """Compiled code that ``write`` gives for ``width`` arms side by side; None if it cannot be.

    The engine's function ``name`` then takes the scene and arguments of those C types, plain
    integers among them; for ``units`` and ``folders`` see ``engine.library``.
    """
    language = "c++" if width > 1 else "c"
    if not compiler.may_build(language):  # writing it takes long
        return None
    try:
        own = compiler.build(write(width), language, local=INCLUDED).library
        engine = library(width, units, folders)
    except CompilerMissing:
        return None
    getattr(engine, name).argtypes = [ADDRESS, *types]  # engine[name] is another object each time
    return Compiled(own, engine)
