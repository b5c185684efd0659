# SPDX-License-Identifier: Apache-2.0
"""The tick of an exported library: the simulator's engine, and functions that call it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, SceneError
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.model.stops import ROUNDING
from arm_sim.derivatives.tangents import TangentFunctions
from arm_sim.export.amalgamated import ELSEWHERE, amalgamated, of_files
from arm_sim.export.linearized import derivatives_of_ticks, effort_slopes
from arm_sim.plant.actuation import actuation
from arm_sim.plant.admissible_states import CLOSURE_TOLERANCE
from arm_sim.plant.parameters import CONSTRAINTS
from arm_sim.plant.plant import Plant
from arm_sim.servo.law import servo_law
from arm_sim.simulation.simulator import Simulator
from arm_sim.stepping.scene_source import braces, scene_source, sizes
from arm_sim.stepping.tick_functions import tick_functions

_PERIOD = "/* Length of a tick in [s]. */\n#define LIBRARY_PERIOD"


@dataclass(frozen=True)
class Tick:
    """The tick of a scene.

    Attributes:
        simulator: The simulator that it equals, in its initial state.
        parameters: Names of the numbers that may be set, in the order of p.
        functions: Functions that the source calls.
        differentiable: Whether there are its derivatives.
        source: C source, with ``library`` for the library's name.
        declarations: What the header declares of it, likewise.
    """

    simulator: Simulator
    parameters: tuple[str, ...]
    functions: tuple[ca.Function, ...]
    differentiable: bool
    source: str
    declarations: str


@one_at_a_time
def tick_of(
    model: ArmModel, pushable: bool = False, servo: bool = False, derivatives: bool = False
) -> Tick:
    """Build the tick of an arm.

    Args:
        model: The arm.
        pushable: Whether external torques on the joints may be set even if the scene does not
            declare them tunable.
        servo: Whether to add the servos of the joints.
        derivatives: Whether to add its derivatives, unless its error is controlled.

    Raises:
        SceneError: If the scene has sensors or lines of commands that are not perfect, or a drive
            whose initial state C does not find.
        KernelError: If the scene has events and there is no compiler.
    """
    _refuse(model)
    simulator = Simulator(model)
    if pushable:
        simulator.arm.use(simulator.arm.compiled.with_external_torques())
    plant, choice, numbers = simulator.arm.plant, simulator.choice, _numbers(simulator.arm.plant)
    functions, smooth = tick_functions(plant, choice, actuation(plant))
    tangents, members = None, dict[str, int]()
    if derivatives and choice.tolerance is None:
        tangents = TangentFunctions(plant, choice, range(len(numbers)), plant.eventful)
        members, names = tangents.members, {function.name() for function in functions}
        functions += [f for f in tangents.of_states if f.name() not in names]
    engine = "\n".join([
        sizes(plant, choice, functions, members), f"#define EVENTS {int(plant.eventful)}",
        "#define EXPORTED static",
        scene_source(plant, choice, functions, smooth, "static const", members),
        '#include "arm/tick.h"\n',
    ])  # fmt: skip
    included = {*ELSEWHERE} | (set() if plant.eventful else {"events/cheapest_tick.h"})
    parts = [amalgamated(engine, included), _defines(simulator)]
    if tangents:
        parts.append(derivatives_of_ticks(tangents, included))
    # What the interface calls besides the functions of the engine.
    functions += [f for f in (plant.mechanics.project, plant.torques) if f is not None]
    interface = {"library.h": "sim.c"}
    if servo:
        interface["servo.h"] = "servo.c"
        functions.append(servo_law(plant, choice.dt))
    if tangents:
        interface["linearize.h"] = "linearize.c"
        functions.append(effort_slopes(plant, len(numbers)))
    parts.append(of_files(list(interface.values()), included | {*interface}) + _setter(numbers))
    return Tick(
        simulator=simulator, parameters=tuple(number.name for number in numbers),
        functions=tuple(functions), differentiable=bool(tangents), source="\n".join(parts),
        declarations=f"{_PERIOD} {choice.dt!r}\n{of_files(list(interface))}",
    )  # fmt: skip


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
    plant = simulator.arm.plant
    project = plant.mechanics.project
    values = {
        "NZ": str(plant.nz), "START": braces(simulator.arm.x),
        "OF_STATE": "{" + (", ".join(map(str, _origins(plant))) or "0") + "}",
        "TUNABLE": braces(plant.parameters.nominal),
        "LOOP_TOLERANCE": repr(CLOSURE_TOLERANCE),
        "STOP_TOLERANCE": repr(ROUNDING),
        **({"LOOPS": str(project.size1_in(2))} if project else {}),
        **({"DRIVEN": "1"} if plant.torques else {}),
    }  # fmt: skip
    return "\n".join(f"#define {name} {value}" for name, value in values.items())


def _origins(plant: Plant) -> list[int]:
    """For each internal state the index in (q, v) of the number that it begins with, -1 for zero.

    The number is recognized by its value, at random q and v, all different.

    Raises:
        SceneError: If one begins with something else.
    """
    n, origins = plant.model.n, list[int]()
    x = np.random.default_rng(0).uniform(1.0, 2.0, 2 * n)
    for k, z in enumerate(plant.laws.initial(x[:n], x[n:])):
        matches = [-1] if z == 0.0 else np.flatnonzero(x == z).tolist()
        if not matches:
            name = plant.laws.names[k] if plant.laws else ""
            raise SceneError(
                f"{name}: an exported tick cannot begin where a transmission has a "
                "kinematic_error; leave that out, or leave out the tick"
            )
        origins += matches
    return origins


@dataclass(frozen=True)
class _Number:
    """A tunable number: its name, and the values that it may have."""

    name: str
    least: float
    most: float


def _numbers(plant: Plant) -> list[_Number]:
    """The tunable numbers in the order of p; switches of constraints, which come last, are not."""
    return [
        _Number(f"{item.name}[{i}]", least, most)
        for item in plant.parameters.items
        if item.name != CONSTRAINTS
        for i, (least, most) in enumerate(
            zip(item.least.tolist(), item.most.tolist(), strict=True)
        )
    ]


def _setter(numbers: Sequence[_Number]) -> str:
    """The function that sets tunable numbers by name.

    Names are compared one by one: a table of them would be data with addresses.
    """
    lines = []
    for i, number in enumerate(numbers):
        violations = [f"value < {number.least!r}"] if number.least > -math.inf else []
        violations += [f"value > {number.most!r}"] if number.most < math.inf else []
        refusal = f"{' || '.join(violations)} ? LIBRARY_NOT_ALLOWED : " if violations else ""
        match = f'is_same(parameter, "{number.name}")'
        lines.append(f"  if ({match}) return {refusal}set_number(sim, {i}, value);")
    return "\n".join([
        "", "int library_sim_set(library_sim* sim, const char* parameter, double value) {",
        *(lines or ["  (void)sim;", "  (void)parameter;", "  (void)value;"]),
        "  return LIBRARY_UNKNOWN;", "}", "",
    ])  # fmt: skip
