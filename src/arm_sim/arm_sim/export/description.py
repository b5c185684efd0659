# SPDX-License-Identifier: Apache-2.0
"""What an exported library says of itself: the first comment of its files, and its README."""

import math
import re

from arm_dynamics import ArmModel, __version__
from arm_sim.export.amalgamated import OWN
from arm_sim.export.library import Library
from arm_sim.export.tick import Tick
from arm_sim.recording.origin import SCENE_FILE, URDF_FILE, versions

_SECTION = re.compile(r"<!-- ([\w ]+) -->\n(.*?)(?=<!-- |\Z)", re.DOTALL)
_MARK = re.compile(r"@(\w+)@")


def about(name: str, model: ArmModel) -> str:
    """The first comment of the library's files."""
    tools = ", ".join(f"{name} {v}" for name, v in versions().items() if name != "machine")
    return (
        f"{name}: the dynamics of robot '{model.pin.name}', made by arm_sim {__version__}\n"
        f"({tools}).\nSPDX-License-Identifier: Apache-2.0"
    )


def readme(library: Library) -> str:
    """``README.md`` of a library, from ``native/README.md.in``."""
    model, tick = library.model, library.tick
    functions = [f"| `{library.name}_{term.name}` | {term.about} |" for term in library.terms]
    marks = {
        "NAME": library.name, "ROBOT": model.pin.name, "JOINTS": str(model.n),
        "MASS": f"{model.total_mass:.6g}",
        "GRAVITY": ", ".join(f"{g:g}" for g in model.scene.gravity), "VERSION": __version__,
        "SCENE": SCENE_FILE, "URDF": URDF_FILE, "JOINT_ROWS": "\n".join(_joint_rows(model)),
        "FUNCTION_ROWS": "\n".join(functions),
        "TOOLS": ", ".join(f"{name} {version}" for name, version in versions().items()),
        **(_marks_of_ticks(model, tick) if tick else {}),
    }  # fmt: skip
    sections = {"all", *(_sections_of_ticks(tick) if tick else ())}
    template = (OWN / "README.md.in").read_text(encoding="utf-8")
    text = _SECTION.sub(lambda section: section[2] if section[1] in sections else "", template)
    return _MARK.sub(lambda mark: marks[mark[1]], text)


def _joint_rows(model: ArmModel) -> list[str]:
    limits = (model.position_lower, model.position_upper, model.velocity_limit, model.effort_limit)
    rows = []
    for i, name in enumerate(model.joint_names):
        of_joint = (float(values[i]) for values in limits)
        numbers = [f"{value:.6g}" if math.isfinite(value) else "none" for value in of_joint]
        rows.append(f"| {i} | {name} | {model.joint_types[i]} | {' | '.join(numbers)} |")
    return rows


def _sections_of_ticks(tick: Tick) -> set[str]:
    controlled = tick.simulator.choice.tolerance is not None
    optional = {
        "servo": "_sim_servo" in tick.declarations,
        "slopes": tick.differentiable,
        "no slopes": controlled and not tick.differentiable,
        "parameters": bool(tick.parameters),
    }
    return {"ticks", *(name for name, present in optional.items() if present)}


def _marks_of_ticks(model: ArmModel, tick: Tick) -> dict[str, str]:
    """What the text says of ticks, by the marks in its place."""
    choice, plant = tick.simulator.choice, tick.simulator.arm.plant
    control = "" if choice.tolerance is None else f", error controlled to {choice.tolerance:g}"
    numbers = zip(tick.parameters, plant.parameters.nominal, strict=False)  # then switches
    return {
        "DT": f"{choice.dt:g}",
        "METHOD": choice.method.name + control,
        "UNITS": ", ".join(dict.fromkeys(model.command_unit)),
        "STATES": str(plant.nx),
        "PARAMETER_ROWS": "\n".join(f"| `{name}` | {value:.17g} |" for name, value in numbers),
    }
