# SPDX-License-Identifier: Apache-2.0
"""C source of the engine in ``native/`` for a scene: definitions, and the file that uses them.

An engine stands in one unit with the functions that it calls, or is a unit of its own, which all
scenes with the same sizes and features share.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
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
INCLUDED = (f"-I{NATIVE}",)
"""Flags for compilers, see ``compiler.build``."""
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
COSTS = {
    "slope_cost": "rhs", "loads_cost": "loads", "inertia_cost": "contact_inertia",
    "strike_cost": "strike", "statics_cost": "statics",
}  # fmt: skip
"""Costs of functions by their names in C."""
_BEFORE_CALLS = '#include "scalar.h"\n#define casadi_int long long int\n'
_SIGNATURE = "int {}(const real** arg, real** res, casadi_int* iw, real* w, int mem)"
_OF_COLUMNS = "void {}(const real* c, const column* const* arg, column* res)"


def engine_source(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function,
    file: str = "motion/roll.c",
) -> str:  # fmt: skip
    """C source of the engine of ticks, to be compiled after the functions that it calls.

    ``smooth`` is the function that advances over a tick without events, ``file`` that of
    ``native`` which calls the engine.
    """
    costs = _costs(plant, choice, functions, smooth)
    return f'{definitions(plant, choice, functions)}{written(costs)}#include "{file}"\n'


def engine_apart(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> tuple[str, str]:
    """C source of a scene's numbers, and of the engine of ticks as a unit of its own.

    Two thirds of the time that a scene with contact takes to compile go into the engine. Apart
    from the numbers it is the same for all scenes with the same sizes and features, and compiled
    once for all of them. Arguments as of ``engine_source``.
    """
    numbers = _numbers(plant) | _costs(plant, choice, functions, smooth)
    shared = sizes(plant, choice, functions)
    # Work space is rounded up, so that similar scenes have the same; not to powers of two, where
    # arrays on the stack would share lines of the processor's cache.
    for name in (name for name in shared if name.startswith("SZ_")):
        shared[name] = str(-(-(int(shared[name]) + 8) // 64) * 64 - 8)
    calls = "".join(f"{_SIGNATURE.format(function.name())};\n" for function in functions)
    engine = f'{_defined(shared)}{without("scene.h", functions)}#include "motion/roll.c"\n'
    return written(numbers, "const"), f"{_BEFORE_CALLS}{calls}{engine}"


def definitions(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], **more: object
) -> str:
    """C source of all that a scene brings besides its functions; see ``native/scene.h``.

    Args:
        plant: Its equations.
        choice: Method, tick and tolerance.
        functions: All of its functions that there are.
        more: Further definitions, or others than those that follow from the plant.
    """
    defined = _defined(sizes(plant, choice, functions) | {k: str(v) for k, v in more.items()})
    return f"{defined}{without('scene.h', functions)}{written(_numbers(plant))}"


def without(header: str, present: Sequence[ca.Function]) -> str:
    """Definitions of a scene's functions that are not there, which are never called.

    Args:
        header: ``scene.h``, or ``scene_columns.h`` for those of columns.
        present: Those that are.
    """
    kind, form = {"scene.h": ("GENERATED", _SIGNATURE)}.get(header, ("COLUMNS", _OF_COLUMNS))
    text = (NATIVE / header).read_text(encoding="utf-8")
    names = re.findall(rf"^{kind}\((\w+)\);", text, re.MULTILINE)
    known = {function.name() for function in present}
    unused = "arg res iw w mem" if kind == "GENERATED" else "c arg res"
    body = "".join(f"  (void){name};\n" for name in unused.split())
    body += "  return 0;\n" if kind == "GENERATED" else ""
    return "".join(
        f"static inline {form.format(name)} {{\n{body}}}\n" for name in names if name not in known
    )


def _defined(values: Mapping[str, str]) -> str:
    return "\n".join(["", *(f"#define {name} {value}" for name, value in values.items()), ""])


def written(numbers: Mapping[str, Array | int], storage: str = "static const") -> str:
    """Tables and whole numbers in C, which knows empty tables as an extension."""
    lines = list[str]()
    for name, value in numbers.items():
        if isinstance(value, int):
            lines.append(f"{storage} long long {name} = {value};")
            continue
        shape = "".join(f"[{size}]" for size in value.shape)
        rows = braces(value) if value.ndim == 1 else f"{{{', '.join(map(braces, value))}}}"
        known = "" if value.size else "__extension__ "
        lines.append(f"{known}{storage} double {name}{shape} = {rows};")
    return "\n".join([*lines, ""])


def sizes(plant: Plant, choice: Choice, functions: Sequence[ca.Function]) -> dict[str, str]:
    """Sizes and features of a scene, for all files of ``native``."""
    stops, statics, controlled = plant.model.stops, plant.events.get("statics"), choice.tolerance
    plain = not (plant.constrained or plant.layout.pressed or plant.layout.switches)
    features = {
        "EVENTS": plant.eventful, "RIGID": stops.rigid.any(),
        "STOPS": bool(stops) and not plant.eventful,
        "FREE": plant.free is not None, "MOVING": plant.glides, "PLAIN": plant.eventful and plain,
        "SHORTCUT": plant.glides and controlled is None and plain, "NB": plant.constrained,
        "INDETERMINATE": statics is not None, "NEAR_LOADS": _returns_loads(functions),
        "ADAPTIVE": controlled is not None,
    }  # fmt: skip
    most = MAX_SUBSTEPS_TOUCHING if plant.points else MAX_SUBSTEPS
    numbers = lengths(plant) | {name: int(bool(has)) for name, has in features.items()} | {
        "NM": 0 if statics is None else statics.size1_out(3), "NR": plant.model.n,
        "ORDER": choice.method.order, "MOST_SUBSTEPS": most,
        "SZ_ARG": max(function.sz_arg() for function in functions) + 8,
        "SZ_RES": max(function.sz_res() for function in functions) + 8,
        "SZ_IW": max(function.sz_iw() for function in functions) + 8,
        "SZ_W": max(function.sz_w() for function in functions) + 8,
    }  # fmt: skip
    named = {name: str(number) for name, number in numbers.items()}
    return named | {"LARGEST": repr(LARGEST), "SLOWEST": repr(AT_REST), "DEEP": repr(INSIDE)}


def _returns_loads(functions: Sequence[ca.Function]) -> bool:
    """Whether steps return the loads at a stage at their end."""
    motion = next((each for each in functions if each.name() in ("step", "attempt")), None)
    plain = {"step": 3, "attempt": 5}
    return motion is not None and motion.n_in() == 5 and motion.n_out() > plain[motion.name()]


def _costs(
    plant: Plant, choice: Choice, functions: Sequence[ca.Function], smooth: ca.Function
) -> dict[str, int]:
    """Costs of functions, and the budget of a tick before the rest of it is time-stepped."""
    of = {function.name(): OVERHEAD + operations(function, WEIGHTS) for function in functions}
    step = of[smooth.name()]
    factor = 1 if choice.tolerance is None else PATIENCE
    parts = plant.model.n + 3 * len(plant.points)
    most = max(MOST_OPERATIONS * factor, LEAST_WORK * step * max(factor, parts))
    known = {cost: of.get(name, 0) for cost, name in COSTS.items()}
    return {"most_work": most, "step_cost": step} | known


def _numbers(plant: Plant) -> dict[str, Array | int]:
    """Numbers of a scene by joint and contact, see ``native/numbers.h``."""
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
    """Numbers as a list for C definitions."""
    return "{" + ", ".join(repr(float(value)) for value in values) + "}"
