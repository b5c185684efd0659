# SPDX-License-Identifier: Apache-2.0
"""The tick of an exported library: the simulator's engine, and the door to it."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, SceneError
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.model.stops import ROUNDED
from arm_sim.plant.actuation import actuation
from arm_sim.plant.placing import OPEN
from arm_sim.plant.plant import Plant
from arm_sim.simulator import Simulator
from arm_sim.stepping.stepper import braces, engine_source, tick_functions

NATIVE = Path(__file__).parent / "native"
_INCLUDES = re.compile(r'^#include "[^"]*"\n', re.MULTILINE)
_COMMENT = re.compile(r"\A/\*.*?\*/\n", re.DOTALL)


@dataclass(frozen=True)
class Tick:
    """The tick of a scene.

    Attributes:
        simulator: The simulator that it equals, in its initial state.
        parameters: Names of the numbers that may be set, in the order of p.
        functions: Functions that the source calls.
        source: C source, with ``library`` for the library's name.
    """

    simulator: Simulator
    parameters: tuple[str, ...]
    functions: tuple[ca.Function, ...]
    source: str


@one_at_a_time
def tick_of(model: ArmModel) -> Tick:
    """Build the tick of an arm.

    Raises:
        SceneError: If the scene has sensors or lines of commands that are not perfect, or a drive
            whose initial state C does not find.
        KernelError: If the scene has events and there is no compiler.
    """
    _refuse(model)
    simulator = Simulator(model)
    plant, choice = simulator.arm.plant, simulator.choice
    functions, smooth = tick_functions(plant, choice, actuation(plant))
    numbers = _numbers(plant)
    engine = engine_source(plant, choice, functions, smooth, "tick.h")
    engine = engine.replace("\nEXPORTED ", "\nstatic ")
    door = _INCLUDES.sub("", _COMMENT.sub("", (NATIVE / "sim.c").read_text()))
    more = [f for f in (plant.project, plant.torques) if f is not None]
    return Tick(
        simulator,
        tuple(number.name for number in numbers),
        (*functions, *more),
        f"{engine}\n{_defines(simulator)}\n{door}{_setter(numbers)}",
    )


def declarations() -> str:
    """What the header declares, with ``library`` for the library's name."""
    return _COMMENT.sub("", (NATIVE / "library.h").read_text()).split("\n", 3)[3]


def _refuse(model: ArmModel) -> None:
    """Refuse a scene whose commands or measurements are not those of the arm itself."""
    if model.scene.sensors is not None:
        raise SceneError(
            "sensors: an exported tick has none, its state is the true one; export a scene "
            "without this key and add them in your own program, or leave out the tick"
        )
    if model.scene.commands is not None and not model.scene.commands.perfect:
        raise SceneError(
            "commands: an exported tick has no delay, jitter or loss; export a scene without "
            "them and add them in your own program, or leave out the tick"
        )


def _defines(simulator: Simulator) -> str:
    """Definitions for ``native/sim.c`` besides those of the engine."""
    plant, choice = simulator.arm.plant, simulator.choice
    project = plant.project
    values = {
        "PERIOD": repr(choice.dt),
        "NZ": str(plant.nz),
        "START": braces(simulator.arm.x),
        "OF_STATE": "{" + ", ".join(map(str, _origins(plant))) + "}",
        "TUNABLE": braces(plant.parameters.nominal),
        "OPEN": repr(OPEN),
        "AT_STOP": repr(ROUNDED),
        "TOLERANCE": repr(choice.tolerance or 0.0),
        **({"LOOPS": str(project.size1_in(2))} if project else {}),
        **({"DRIVEN": "1"} if plant.torques else {}),
    }
    return "\n".join(f"#define {name} {value}" for name, value in values.items())


def _origins(plant: Plant) -> list[int]:
    """For each internal state the number of the state that it begins with, -1 for zero.

    Raises:
        SceneError: If one begins with something else.
    """
    n, found = plant.model.n, list[int]()
    x = np.random.default_rng(0).uniform(1.0, 2.0, 2 * n)
    for k, z in enumerate(plant.initial(x[:n], x[n:])):
        same = [-1] if z == 0.0 else np.flatnonzero(x == z).tolist()
        if not same:
            name = plant.laws.names[k] if plant.laws else ""
            raise SceneError(
                f"{name}: an exported tick cannot begin where a transmission has a "
                "kinematic_error; leave that out, or leave out the tick"
            )
        found += same
    return found


@dataclass(frozen=True)
class _Number:
    """A tunable number: its name, and the least value that it may have."""

    name: str
    least: float = -math.inf


def _numbers(plant: Plant) -> list[_Number]:
    """The tunable numbers in the order of p; switches of constraints, which come last, are not."""
    found, least = list[_Number](), abs(plant.model.friction.viscous.skew)
    for item in plant.parameters.items:
        for i in range(item.nominal.size if item.name != "constraints" else 0):
            lower = float(least[i]) if item.name == "friction" else -math.inf
            found.append(_Number(f"{item.name}[{i}]", lower))
    return found


def _setter(numbers: Sequence[_Number]) -> str:
    """The function that sets tunable numbers by name.

    Names are compared one by one: a table of them would be data with addresses.
    """
    lines = [
        f'  if (is_same(parameter, "{number.name}")) '
        + (f"return value < {number.least!r} ? LIBRARY_NOT_ALLOWED : put(sim, {i}, value);"
           if number.least > -math.inf else f"return put(sim, {i}, value);")
        for i, number in enumerate(numbers)
    ]  # fmt: skip
    return "\n".join([
        "", "int library_sim_set(library_sim* sim, const char* parameter, double value) {",
        *(lines or ["  (void)sim;", "  (void)parameter;", "  (void)value;"]),
        "  return LIBRARY_UNKNOWN;", "}", "",
    ])  # fmt: skip
