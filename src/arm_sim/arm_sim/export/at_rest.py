# SPDX-License-Identifier: Apache-2.0
"""Forward dynamics where joints with dry friction are at rest: which of them stick.

The simulator's engine chooses the modes, as in a tick, for the arm without contacts, end stops and
drives, which forward dynamics leave out.
"""

from __future__ import annotations

import re
from copy import copy
from pathlib import Path

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.model.stops import stops_of
from arm_sim.export.generated import prefixed, static_functions
from arm_sim.plant.plant import Plant
from arm_sim.stepping.engine import braces, event_sizes, sizes, source

PREFIX = "rest_"
"""Begins the names of this part of a library."""
_NATIVE = Path(__file__).parent / "native"
_HEAD = re.compile(r"\A/\*.*?\*/\n\n(?:#include [^\n]*\n)*", re.DOTALL)
_COSTS = ("STEP", "SLOPE", "LOADS", "INERTIA", "STRIKE", "STATICS")


@one_at_a_time
def at_rest(model: ArmModel) -> str:
    """C source of ``rest_is_resting`` and ``rest_begin_motion``, see ``native/at_rest.c``.

    Empty for an arm without dry friction that can stick.
    """
    if not model.has_dry_friction:
        return ""
    plant = _bare(model)
    functions = [plant.slope_of_loads(), *plant.events.values(), _acting(model)]
    defines = {
        **sizes(plant, functions),
        **event_sizes(plant),
        **{f"COST_{name}": "0" for name in _COSTS},
        "MOST_WORK": "0",
        "TUNABLE": braces(plant.parameters.nominal),
    }
    engine = source(defines, "modes.h", () if "TOGETHER" in defines else ("together.h",))
    door = _HEAD.sub("", (_NATIVE / "at_rest.c").read_text(encoding="utf-8"))
    text = static_functions(functions) + engine.replace("\nEXPORTED ", "\nstatic ") + door
    return prefixed(text, PREFIX)


def _bare(model: ArmModel) -> Plant:
    """The arm under torques on its joints, without contacts, end stops and states of drives."""
    scene = model.scene
    held = tuple(scene.bilateral.values())
    bare = copy(ArmModel(scene.model_copy(update={"constraints": held})))
    vars(bare)["stops"] = stops_of((), bare.joint_names)
    return Plant(bare, stops=False).under_torques()


def _acting(model: ArmModel) -> ca.Function:
    """Torques less those of friction models with states, in steady motion."""
    q, v, tau = (ca.SX.sym(name, model.n) for name in ("q", "v", "tau"))
    lost = SteadyFriction.of(model).of_laws(v, ca.sign(v), q, tau)
    return ca.Function("acting_torques", [q, v, tau], [ca.densify(tau - lost)], {"cse": True})
