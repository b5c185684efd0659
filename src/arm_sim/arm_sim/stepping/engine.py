# SPDX-License-Identifier: Apache-2.0
"""The engine in ``native/``, a C library that is compiled once, and what a scene brings to it.

Generated C of a scene contains its functions and a structure of sizes, constants and pointers to
them, ``scene_t`` of ``scene.h``, which all functions of the engine take.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.equations.contact import AT_REST
from arm_sim.integrators.selection import Choice
from arm_sim.plant.placing import INSIDE
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import LARGEST, MAX_SUBSTEPS, MAX_SUBSTEPS_TOUCHING
from arm_sim.stepping.events import lengths

NATIVE = Path(__file__).parent / "native"
# Flags for compilers, see ``compiler.build``
INCLUDED = (f"-I{NATIVE}",)
OF_LANES = (
    "lanes/rollout.c", "lanes/controlled_rollout.c", "derivatives/gradient.c",
    "derivatives/tangent_ticks.c",
)  # fmt: skip
# Units of the library for one arm at a time, and of that for several side by side
OF_ONE_ARM = (
    "arm/arm.c", *OF_LANES, "derivatives/tick_derivative.c", "derivatives/tangent_step.c",
    "derivatives/eventful_derivatives.c", "derivatives/event_free_gradient.c",
)  # fmt: skip
# The engine consists of loops, unlike generated code: short ones, slower as calls of memcpy.
_FLAGS = ("-O2", "-fno-tree-loop-distribute-patterns", *compiler.FLAGS[1:])
# Position of a stop that does not exist: beyond every position
NOWHERE = sys.float_info.max
# Budget of a tick with events before it is time-stepped: arithmetic operations (less than a
# millisecond), smooth motions that it may always take for each joint and each direction of a
# contact, a factor with error control, and the overhead of a call in operations.
MOST_OPERATIONS, LEAST_WORK, PATIENCE, OVERHEAD = 1_000_000, 20, 50, 100
# Operations that take as long as several additions
WEIGHTS = {
    ca.OP_EXP: 20, ca.OP_LOG: 20, ca.OP_POW: 50, ca.OP_TANH: 30, ca.OP_SQRT: 5, ca.OP_DIV: 4
}  # fmt: skip
# Costs of functions by their names in C
COSTS = {
    "slope_cost": "rhs", "loads_cost": "loads", "mobility_cost": "contact_mobility",
    "impact_cost": "impact_map", "statics_cost": "statics",
}  # fmt: skip
# Name of the structure in generated code
SYMBOL = "own_scene"
_HEADER = Header(NATIVE / "scene.h", only="scene_t most")
_SCENE, _MOST = _HEADER.fields("scene_t"), _HEADER.constants
# Members that lengths of arrays depend on; their names in capitals are macros
SIZES = tuple(name for name, kind in _SCENE[: [n for n, _ in _SCENE].index("adaptive")])


@cache
def _library(where: compiler.Destination | None, width: int, units: tuple[str, ...],
             folders: tuple[str, ...]) -> ctypes.CDLL:  # fmt: skip
    head = '#include "scalar.h"' if width == 1 else f'#define LANES {width}\n#include "lanes.hpp"'
    first, *rest = (f'{head}\n#include "{unit}"\n' for unit in units)
    local, language = (*INCLUDED, *folders), "c" if width == 1 else "c++"
    with compiler.describing("engine"):
        return compiler.build(first, language, _FLAGS, local, tuple(rest)).library


def library(
    width: int = 1, units: tuple[str, ...] = (), folders: tuple[str, ...] = ()
) -> ctypes.CDLL:
    """The engine's library, compiled at its first use.

    Args:
        width: Arms side by side.
        units: Files of it; all, if none is named.
        folders: Flags for the compiler that name folders of other files.

    Raises:
        CompilerMissing: If there is neither a compiler nor a library compiled elsewhere.
    """
    units = units or (OF_ONE_ARM if width == 1 else OF_LANES)
    return _library(compiler.destination(), width, units, folders)


class Compiled:
    """Compiled functions of a scene, and the engine for as many arms side by side.

    Attributes:
        own: Library of the scene.
        engine: That of the engine.
        scene: Address of its structure, the first argument of the engine's functions.
    """

    def __init__(self, own: ctypes.CDLL, engine: ctypes.CDLL) -> None:
        self.own, self.engine = own, engine
        self.scene = ctypes.c_void_p(address_of(own))

    @cached_property
    def tick(self) -> int | None:
        """Address of the engine's function for one tick of one arm."""
        return ctypes.cast(self.engine.arm_tick, ctypes.c_void_p).value


@cache
def address_of(own: ctypes.CDLL, symbol: str = SYMBOL) -> int:
    """Address of a structure in a library of generated code."""
    return ctypes.addressof(ctypes.c_char.in_dll(own, symbol))


def scene_source(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function],
    smooth: ca.Function | None = None, storage: str = "EXPORTED const",
    more: Mapping[str, int] = MappingProxyType({}),
) -> str:  # fmt: skip
    """C of the structure of a scene, to be compiled after its functions.

    Args:
        plant: Its equations.
        choice: Method, tick and tolerance.
        functions: All of its functions that there are.
        smooth: That of them which advances over a tick without events, for the engine of ticks.
        storage: Of the structure.
        more: Members that do not follow from the plant, or replace those that do.
    """
    members = _members(plant, choice, functions) | dict(more)
    if smooth is not None:
        members |= _costs(plant, choice, functions, smooth)
    names, numbers = {function.name() for function in functions}, _numbers(plant)
    tables, values = list[str](), list[str]()
    for name, _ in _SCENE:
        value: object = members.get(name, 0)
        if name in numbers and numbers[name].size:
            table = numbers[name]
            shape = "".join(f"[{size}]" for size in table.shape)
            if table.ndim == 2:
                rows = f"{{{braces(table[0])}, {braces(table[1])}}}"
                value = f"{{{name}[0], {name}[1]}}"
            else:
                rows, value = braces(table), name
            tables.append(f"static const double {name}{shape} = {rows};\n")
        elif name in names:
            value = name
        values.append(f"  {value}, /* {name} */\n")
    structure = "".join([*tables, f"{storage} scene_t {SYMBOL} = {{\n", *values, "};\n"])
    return f'#include "scene.h"\n{structure}'


def sizes(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function],
    more: Mapping[str, int] = MappingProxyType({}),
) -> str:  # fmt: skip
    """C definitions of a scene's sizes, for a unit that is for this scene alone."""
    members = dict.fromkeys(SIZES, 0) | _members(plant, choice, functions) | dict(more)
    return "".join(f"#define {name.upper()} {members[name]}\n" for name in SIZES)


def _members(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function]
) -> dict[str, int | float]:
    """Sizes and features of a scene."""
    stops, statics, controlled = plant.model.stops, plant.events.get("statics"), choice.tolerance
    plain = not (plant.constrained or plant.layout.pressed or plant.layout.switches)
    results = [(function.name(), function.n_out()) for function in functions]
    features = {
        "adaptive": controlled is not None, "constrained": plant.constrained,
        "rigid": stops.rigid.any(), "stops": bool(stops) and not plant.eventful,
        "free": plant.free is not None, "moving": plant.has_sliding_modes,
        "joints_and_contacts_only": plant.eventful and plain,
        "event_free_shortcut": plant.has_sliding_modes and controlled is None and plain,
        "near_loads": ("step", 5) in results or ("attempt", 7) in results,
        "indeterminate": statics is not None,
        "eventful": plant.eventful,
    }  # fmt: skip
    most = max(max(function.sz_arg(), function.sz_res()) for function in functions)
    assert most <= _MOST["MOST_ARGUMENTS"], f"a function with {most} arguments or results"
    assert max(function.sz_iw() for function in functions) <= _MOST["MOST_INTEGERS"]
    numbers = {
        "sz_w": max(function.sz_w() for function in functions) + 1,
        "nm": 0 if statics is None else statics.size1_out(3), "nr": plant.model.n,
        "order": choice.method.order, "tolerance": choice.tolerance or 0.0,
        "most_substeps": MAX_SUBSTEPS_TOUCHING if plant.points else MAX_SUBSTEPS,
        "largest": LARGEST, "deep": INSIDE, "slowest": AT_REST,
    }  # fmt: skip
    of_plant = {name.lower(): size for name, size in lengths(plant).items()}
    return of_plant | {name: int(bool(has)) for name, has in features.items()} | numbers


def _costs(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> dict[str, int]:
    """Costs of functions, and the budget of a tick before the rest of it is time-stepped."""
    costs = {function.name(): OVERHEAD + operations(function, WEIGHTS) for function in functions}
    step = costs[smooth.name()]
    factor = 1 if choice.tolerance is None else PATIENCE
    parts = plant.model.n + 3 * len(plant.points)
    most = max(MOST_OPERATIONS * factor, LEAST_WORK * step * max(factor, parts))
    members = {member: costs.get(name, 0) for member, name in COSTS.items()}
    return {"most_work": most, "step_cost": step} | members


def _numbers(plant: Plant) -> Mapping[str, Array]:
    """Numbers of a scene by joint and contact."""
    model, points, stops = plant.model, plant.points, plant.model.stops
    soft_lower = np.where(stops.compliant[0], stops.place[0], -NOWHERE)
    soft_upper = np.where(stops.compliant[1], stops.place[1], NOWHERE)
    return {
        "stop_place": np.clip(stops.place, -NOWHERE, NOWHERE),
        "rigid_stop": np.clip(stops.bounds, -NOWHERE, NOWHERE),
        "rebound_of": np.array(stops.restitution),
        "soft_stop": np.array([soft_lower, soft_upper]),
        "static_level": model.friction.level,
        "wave_number": _wave_numbers(model),
        "friction": np.array([point.friction for point in points]),
        "holding": np.array([point.static_friction for point in points]),
        "restitution": np.array([point.restitution for point in points]),
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


def braces(values: Sequence[float] | Array) -> str:
    """Numbers as a list for C definitions, which C does not know empty."""
    return "{" + (", ".join(repr(float(value)) for value in values) or "0.0") + "}"
