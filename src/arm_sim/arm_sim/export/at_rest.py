# SPDX-License-Identifier: Apache-2.0
"""Forward dynamics where joints with dry friction are at rest: which of them stick.

The simulator's engine chooses the modes, as in a tick, for the arm without contacts, end stops and
drives, which forward dynamics leave out.
"""

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.attributes import with_values
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.model.stops import stops_of
from arm_sim.export.amalgamated import ELSEWHERE, amalgamated
from arm_sim.export.generated import prefixed, static_functions
from arm_sim.integrators.methods import METHODS
from arm_sim.integrators.selection import Choice
from arm_sim.plant.options import Options
from arm_sim.plant.plant import Plant, slope_of_loads
from arm_sim.stepping.scene_source import braces, scene_source, sizes

# Begins the names of this part of a library
PREFIX = "rest_"


@one_at_a_time
def at_rest(model: ArmModel) -> str:
    """C of ``is_resting`` and ``accelerations_at_rest`` of ``native/at_rest.c``, with the prefix.

    Empty for an arm without dry friction that can stick.
    """
    if not model.has_dry_friction:
        return ""
    plant = _bare(model)
    functions = [slope_of_loads(plant), *plant.events.values(), _acting(model)]
    choice = Choice(METHODS["rk4"], 1.0, None, "")  # of steps that are not made
    text = "\n".join([
        sizes(plant, choice, functions), f"#define TUNABLE {braces(plant.parameters.nominal)}",
        "#define EXPORTED static", static_functions(functions),
        scene_source(plant, choice, functions, storage="static const"), '#include "at_rest.c"\n',
    ])  # fmt: skip
    return prefixed(amalgamated(text, {*ELSEWHERE}), PREFIX)


def _bare(model: ArmModel) -> Plant:
    """The arm under torques on its joints, without contacts, end stops and states of drives."""
    scene = model.scene
    held = tuple(scene.bilateral.values())
    model = ArmModel(scene.model_copy(update={"constraints": held}))
    bare = with_values(model, stops=stops_of((), model.joint_names))
    return Plant(bare, Options(stops=False, drives=False))


def _acting(model: ArmModel) -> ca.Function:
    """Torques less those of friction models with states, in steady motion."""
    q, v, tau = (ca.SX.sym(name, model.n) for name in ("q", "v", "tau"))
    lost = SteadyFriction.of(model).of_laws(v, ca.sign(v), q, tau)
    return ca.Function("acting_torques", [q, v, tau], [ca.densify(tau - lost)], {"cse": True})
