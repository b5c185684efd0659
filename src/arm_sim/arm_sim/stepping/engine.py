# SPDX-License-Identifier: Apache-2.0
"""C source of the engines in ``native/`` for a scene: definitions, and the files that use them.

An engine stands in one unit with the functions that it calls, or is a unit of its own, which all
scenes with the same sizes and features share.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.equations.contact import AT_REST
from arm_sim.integrators.selection import Choice
from arm_sim.plant.placing import INSIDE
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import LARGEST, MAX_SUBSTEPS, MAX_SUBSTEPS_TOUCHING
from arm_sim.stepping.events import lengths

NATIVE = Path(__file__).parent / "native"
NOWHERE = sys.float_info.max
"""Position of a stop that does not exist: beyond every position."""
MOST_OPERATIONS, LEAST_WORK, PATIENCE, OVERHEAD = 1_000_000, 20, 50, 100
"""Budget of a tick with events before it is time-stepped: arithmetic operations (less than a
millisecond), smooth motions that it may always take for each joint and each direction of a
contact, a factor with error control, and the overhead of a call in operations."""
WEIGHTS = {
    ca.OP_EXP: 20, ca.OP_LOG: 20, ca.OP_POW: 50, ca.OP_TANH: 30, ca.OP_SQRT: 5, ca.OP_DIV: 4
}  # fmt: skip
"""Operations that take as long as several additions."""
FOR_EDITORS = ("scene.h", "scene_columns.h")
"""Files of ``native`` that stand for the definitions and the generated functions of a scene."""
_ROOM = re.compile(r"SZ_\w+")  # work space
# A number of a scene, and the definitions that it takes.
_DECLARED = re.compile(r"\bOF_SCENE (.*?) VALUE\((.*?)\);")
_BEFORE_CALLS = '#include "scalar.h"\n#define casadi_int long long int\n'
_ARGUMENTS = "const real** arg, real** res, casadi_int* iw, real* w, int mem"
_INCLUDES = re.compile(r'(?:#pragma once\n)?((?:#include "\w+\.h"\n)+)\n')


def engine_source(
    plant: Plant,
    choice: Choice,
    functions: Sequence[ca.Function],
    smooth: ca.Function,
    file: str = "roll.c",
) -> str:
    """C source of the engine of ticks, to be compiled after the functions that it calls.

    ``smooth`` is the function that advances over a tick without events, ``file`` that of
    ``native`` which calls the engine.
    """
    defines, without = _definitions(plant, choice, functions, smooth)
    return source(defines, file, without)


def engine_apart(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> tuple[str, str]:
    """C source of a scene's numbers, and of the engine of ticks as a unit of its own.

    Two thirds of the time that a scene with contact takes to compile go into the engine. Apart
    from the numbers it is the same for all scenes with the same sizes and features, and compiled
    once for all of them. Arguments as of ``engine_source``.
    """
    defines, without = _definitions(plant, choice, functions, smooth)
    numbers = source(defines | {"OF_SCENE": "const", "VALUE(...)": "= __VA_ARGS__"}, "costs.h")
    values = " ".join(value for _, value in _DECLARED.findall(numbers))
    own = set(re.findall(r"\w+", values))
    shared = {name: value for name, value in defines.items() if name not in own}
    # Work space is rounded up, so that similar scenes have the same; not to powers of two, where
    # arrays on the stack would share lines of the processor's cache.
    for name in filter(_ROOM.fullmatch, shared):
        shared[name] = str(-(-(int(shared[name]) + 8) // 64) * 64 - 8)
    calls = "".join(f"int {function.name()}({_ARGUMENTS});\n" for function in functions)
    shared |= {"OF_SCENE": "extern const", "VALUE(...)": ""}
    return numbers, f"{_BEFORE_CALLS}{calls}{source(shared, 'roll.c', without)}"


def source(defines: dict[str, str], file: str = "", without: Collection[str] = ()) -> str:
    """Definitions, followed by a file of ``native`` and the files that it includes, each once.

    The definitions take the place of ``FOR_EDITORS``.

    Args:
        defines: Values of names; without OF_SCENE, numbers of the scene are defined in place.
        file: The file; empty for none.
        without: Files that are not needed, nor what only they include.
    """
    lines = [f"#define {name} {value}" for name, value in defines.items()]
    text = "\n".join(["", *lines, *_included(file, {*FOR_EDITORS, *without})])
    return text if "OF_SCENE" in defines else _DECLARED.sub(r"static const \1 = \2;", text)


def _included(file: str, done: set[str]) -> Iterator[str]:
    """The texts of the files that a file includes, and its own, without their includes."""
    if not file or file in done:
        return
    done.add(file)
    text = (NATIVE / file).read_text(encoding="utf-8")
    found = _INCLUDES.search(text)
    for other in re.findall(r'"(\w+\.h)"', found[1] if found else ""):
        yield from _included(other, done)
    yield _INCLUDES.sub("", text, count=1)


def _definitions(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> tuple[dict[str, str], set[str]]:
    """Definitions for the engine of ticks, and the files that it does not need."""
    defines, without = sizes(plant, functions), set[str]()
    if choice.tolerance is None:
        without.add("substeps.h")
    else:
        defines |= {"ADAPTIVE": "1"} | error_control(plant, choice)
    if plant.eventful:
        defines |= event_sizes(plant) | near_loads(functions)
        defines |= _work(plant, choice, functions, smooth)
    else:
        without.add("events.h")
    if plant.glides and choice.tolerance is None and _is_plain(plant):
        defines["CLEAR"] = "1"
    else:
        without.add("clear.h")
    if "TOGETHER" not in defines:
        without.add("together.h")
    return defines, without


def sizes(plant: Plant, functions: Sequence[ca.Function]) -> dict[str, str]:
    """Sizes of a scene, its functions and its largest numbers, as definitions for C drivers."""
    return {
        **{name: str(lengths(plant)[name]) for name in ("NX", "NU", "NP")},
        "LARGEST": repr(LARGEST),
        "SZ_ARG": str(max(function.sz_arg() for function in functions) + 8),
        "SZ_RES": str(max(function.sz_res() for function in functions) + 8),
        "SZ_IW": str(max(function.sz_iw() for function in functions) + 8),
        "SZ_W": str(max(function.sz_w() for function in functions) + 8),
    }


def near_loads(functions: Sequence[ca.Function]) -> dict[str, str]:
    """Definition for steps that return the loads at a stage at their end."""
    motion = next(function for function in functions if function.name() in ("step", "attempt"))
    plain = {"step": 3, "attempt": 5}[motion.name()]
    return {"NEAR_LOADS": "1"} if motion.n_in() == 5 and motion.n_out() > plain else {}


def error_control(plant: Plant, choice: Choice) -> dict[str, str]:
    """Definitions for ``native/substeps.h`` and the loops that use it."""
    most = MAX_SUBSTEPS_TOUCHING if plant.points else MAX_SUBSTEPS
    return {"ORDER": str(choice.method.order), "MOST_SUBSTEPS": str(most)}


def _work(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> dict[str, str]:
    """Costs of functions, and the budget of a tick before the rest of it is time-stepped."""
    of = {function.name(): OVERHEAD + operations(function, WEIGHTS) for function in functions}
    step = of[smooth.name()]
    factor = 1 if choice.tolerance is None else PATIENCE
    parts = plant.model.n + 3 * len(plant.points)
    most = max(MOST_OPERATIONS * factor, LEAST_WORK * step * max(factor, parts))
    return {
        "MOST_WORK": f"{most}LL", "COST_STEP": str(step), "COST_SLOPE": str(of["rhs"]),
        "COST_LOADS": str(of["loads"]), "COST_INERTIA": str(of.get("contact_inertia", 0)),
        "COST_STRIKE": str(of.get("strike", 0)), "COST_STATICS": str(of.get("statics", 0)),
    }  # fmt: skip


def mode_sizes(plant: Plant) -> dict[str, str]:
    """Numbers of contacts, of joints with directions and compliant stops, and of switches."""
    return {name: str(lengths(plant)[name]) for name in ("NC", "ND", "NQ", "NK")}


def stop_places(plant: Plant) -> dict[str, str]:
    """Positions of rigid and compliant stops, for ``native/stops.h``."""
    lower, upper = np.clip(plant.model.stops.place, -NOWHERE, NOWHERE)
    return {"LOWEST": braces(lower), "HIGHEST": braces(upper)}


def event_sizes(plant: Plant) -> dict[str, str]:
    """Definitions for the logic of events: stops, contacts, friction, constraints."""
    model, points, stops = plant.model, plant.points, plant.model.stops
    lower, upper = np.clip(stops.bounds, -NOWHERE, NOWHERE)
    return {
        **stop_places(plant),
        **mode_sizes(plant),
        "NB": "1" if plant.constrained else "0",
        **({"RIGID": "1"} if stops.rigid.any() else {}),
        **({"FREE": "1"} if plant.free else {}),
        **({"MOVING": "1"} if plant.glides else {}),
        **({"CALM": "1"} if _is_plain(plant) else {}),
        **_together_sizes(plant),
        "LOWER": braces(lower),
        "UPPER": braces(upper),
        "LOWER_REBOUND": braces(stops.restitution[0]),
        "UPPER_REBOUND": braces(stops.restitution[1]),
        "SOFT_LOWER": braces(np.where(stops.compliant[0], stops.place[0], -NOWHERE)),
        "SOFT_UPPER": braces(np.where(stops.compliant[1], stops.place[1], NOWHERE)),
        "STATIC": braces(model.friction.level),
        "FRICTION": braces([point.friction for point in points]),
        "HOLDING": braces([point.static_friction for point in points]),
        "RESTITUTION": braces([point.restitution for point in points]),
        "WAVES": braces(_wave_numbers(model)),
        "SLOWEST": repr(AT_REST),
        "DEEP": repr(INSIDE),
    }


def _wave_numbers(model: ArmModel) -> Array:
    """Phase of the fastest wave in each joint's position in [rad/rad] or [rad/m].

    Inertia and gravity have at most two periods in a revolution of a link.
    """
    most = 2.0 * abs(model.followers).sum(axis=0)
    for i, drive in enumerate(model.drives):
        if drive is not None:
            teeth = drive.coupling.kinematic_error if drive.coupling else None
            waves = [wave for wave in (drive.motor.cogging, teeth) if wave]
            most[i] = max([most[i], *(abs(drive.motor.gear_ratio) * wave.order for wave in waves)])
        table = model.friction.tables[i]
        for curve in filter(None, (model.friction.position[i], *(table.shares if table else ()))):
            most[i] = max(most[i], np.pi / np.diff(curve.at).min())
    return most


def _is_plain(plant: Plant) -> bool:
    """Whether modes are those of joints with dry friction or rigid stops and of contacts alone."""
    return not (plant.constrained or plant.pressed or plant.switches)


def _together_sizes(plant: Plant) -> dict[str, str]:
    """Definitions for ``native/together.h``; empty where nothing can hold together."""
    statics = plant.events.get("statics")
    return {} if statics is None else {"TOGETHER": "1", "NM": str(statics.size1_out(3))}


def braces(values: Sequence[float] | Array) -> str:
    """Numbers as a list for C definitions."""
    return "{" + ", ".join(repr(float(value)) for value in values) + "}"
