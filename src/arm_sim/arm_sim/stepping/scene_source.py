# SPDX-License-Identifier: Apache-2.0
"""C of what a scene brings to the engine: sizes, constants, and pointers to its functions.

They are a structure, ``scene_t`` of ``scene.h``, which all functions of the engine take.
"""

import sys
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.equations.contact import AT_REST
from arm_sim.integrators.selection import Choice
from arm_sim.plant.admissible_states import PENETRATION_TOLERANCE
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import LARGEST, MAX_SUBSTEPS, MAX_SUBSTEPS_TOUCHING
from arm_sim.stepping.engine import NATIVE, SYMBOL
from arm_sim.stepping.events import array_lengths

# Position of a stop that does not exist: beyond every position
NOWHERE = sys.float_info.max
# Budget of a tick with events before it is time-stepped: arithmetic operations, which take less
# than a millisecond, or at least so many smooth motions for each joint and each direction of a
# contact; and its factor with error control
MOST_OPERATIONS, LEAST_MOTIONS, ADAPTIVE_FACTOR = 1_000_000, 20, 50
OVERHEAD = 100  # of a call, in operations
# Operations that take as long as several additions
WEIGHTS = {
    ca.OP_EXP: 20, ca.OP_LOG: 20, ca.OP_POW: 50, ca.OP_TANH: 30, ca.OP_SQRT: 5, ca.OP_DIV: 4
}  # fmt: skip
# Costs of functions by their names in C
COSTS = {
    "slope_cost": "rhs", "loads_cost": "loads", "mobility_cost": "contact_mobility",
    "impact_cost": "impact_map", "statics_cost": "statics",
}  # fmt: skip
_SCENE = Header(NATIVE / "scene.h", only="scene_t").fields("scene_t")
_CAPACITY = Header(NATIVE / "generated_call.h", only="capacity").constants
# Members that lengths of arrays depend on, all before ``adaptive``; their names in capitals are
# macros
SIZES = tuple(name for name, kind in _SCENE[: [n for n, _ in _SCENE].index("adaptive")])


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
    stops, statics, tolerance = plant.model.stops, plant.events.get("statics"), choice.tolerance
    plain = not (plant.constrained or plant.layout.pressed or plant.layout.switches)
    results = [(function.name(), function.n_out()) for function in functions]
    features = {
        "adaptive": tolerance is not None, "constrained": plant.constrained,
        "has_stops_without_events": bool(stops) and not plant.eventful, "rigid": stops.rigid.any(),
        "has_free_equations": plant.free is not None,
        "has_moving_equations": plant.has_sliding_modes,
        "joints_and_contacts_only": plant.eventful and plain,
        "has_shortcut": plant.has_sliding_modes and tolerance is None and plain,
        "has_near_loads": ("step", 5) in results or ("attempt", 7) in results,
        "indeterminate": statics is not None, "eventful": plant.eventful,
    }  # fmt: skip
    most = max(max(function.sz_arg(), function.sz_res()) for function in functions)
    assert most <= _CAPACITY["ARGUMENT_CAPACITY"], f"a function with {most} arguments or results"
    assert max(function.sz_iw() for function in functions) <= _CAPACITY["INTEGER_CAPACITY"]
    numbers = {
        "sz_w": max(function.sz_w() for function in functions) + 1,
        "nm": 0 if statics is None else statics.size1_out(3), "nr": plant.model.n,
        "order": choice.method.order, "tolerance": choice.tolerance or 0.0,
        "substep_limit": MAX_SUBSTEPS_TOUCHING if plant.points else MAX_SUBSTEPS,
        "largest": LARGEST, "penetration_limit": PENETRATION_TOLERANCE, "slowest": AT_REST,
    }  # fmt: skip
    of_plant = {name.lower(): size for name, size in array_lengths(plant).items()}
    return of_plant | {name: int(bool(has)) for name, has in features.items()} | numbers


def _costs(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> dict[str, int]:
    """Costs of functions, and the budget of a tick before the rest of it is time-stepped."""
    costs = {function.name(): OVERHEAD + operations(function, WEIGHTS) for function in functions}
    step = costs[smooth.name()]
    factor = 1 if choice.tolerance is None else ADAPTIVE_FACTOR
    parts = plant.model.n + 3 * len(plant.points)
    most = max(MOST_OPERATIONS * factor, LEAST_MOTIONS * step * max(factor, parts))
    members = {member: costs.get(name, 0) for member, name in COSTS.items()}
    return {"work_limit": most, "step_cost": step} | members


def _numbers(plant: Plant) -> Mapping[str, Array]:
    """Numbers of a scene by joint and contact."""
    model, points, stops = plant.model, plant.points, plant.model.stops
    soft_lower = np.where(stops.compliant[0], stops.place[0], -NOWHERE)
    soft_upper = np.where(stops.compliant[1], stops.place[1], NOWHERE)
    return {
        "stop_place": np.clip(stops.place, -NOWHERE, NOWHERE),
        "rigid_stop": np.clip(stops.bounds, -NOWHERE, NOWHERE),
        "stop_restitution": np.array(stops.restitution),
        "soft_stop": np.array([soft_lower, soft_upper]),
        "static_level": model.friction.level,
        "wave_number": _wave_numbers(model),
        "friction": np.array([point.friction for point in points]),
        "static_friction": np.array([point.static_friction for point in points]),
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
