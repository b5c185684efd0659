# SPDX-License-Identifier: Apache-2.0
"""The controller of a run, in Python or in compiled code, whose inputs are its gains."""

import json
from dataclasses import fields
from functools import lru_cache

import casadi as ca
import numpy as np

from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.arrays import Array
from arm_dynamics.control import NAMES, Law, Settings, make_controller
from arm_dynamics.control.compiled_law import command_function
from arm_dynamics.control.custom import is_own
from arm_dynamics.exceptions import choices
from arm_studies.sweeps.keys import below, values_below, with_values
from arm_studies.sweeps.runs import Job, Recipe
from arm_studies.sweeps.study import ControllerChoice, validated

# Controllers without memory that are compiled into the simulation, and the settings that they
# support; with others a run uses the Python controller.
LAWS = ("computed_torque", "pd", "pd_gravity", "feed_forward", "float")
GAINS = ("dt", "bandwidth", "damping_ratio")
IMPERFECT = ("sensors", "commands")  # keys of imperfections, which need a Python controller


def controller_of(recipe: Recipe, job: Job) -> ControllerChoice:
    """The controller of a run.

    Raises:
        InvalidInput: If it or a setting is unknown or not allowed.
    """
    return _with_values(recipe.controller, json.dumps(values_below(job.values, "controller")))


@lru_cache(maxsize=64)
def _with_values(controller: str, values: str) -> ControllerChoice:
    """The study's choice with varied values, both as JSON."""
    data = with_values({"controller": json.loads(controller)}, json.loads(values))["controller"]
    choice = validated(ControllerChoice, data, "controller")
    if choice.name not in NAMES and not is_own(choice.name):
        allowed = choices(choice.name, NAMES)
        raise InvalidInput(f"controller = {choice.name!r}; allowed: {allowed}")
    names = [field.name for field in fields(Settings)]
    for key in choice.settings:
        if key not in names:
            raise InvalidInput(
                f"unknown setting 'controller.settings.{key}'; allowed: {choices(key, names)}"
            )
    Settings(**choice.settings)
    return choice


def runs_compiled(recipe: Recipe, job: Job) -> bool:
    """Whether a run is simulated entirely in compiled code, with an ideal measured state."""
    choice, defaults = controller_of(recipe, job), Settings()
    return (
        choice.name in LAWS
        and not recipe.imperfect
        and not any(below(key, IMPERFECT) for key in job.values)
        and all(
            key in GAINS or np.array_equal(value, getattr(defaults, key))
            for key, value in choice.settings.items()
        )
    )


def law(name: str, dynamics: Dynamics) -> ca.Function:
    """One of ``LAWS`` for ``CompiledControl``; numbers of r as of ``gains``."""
    return command_function(_law(name, dynamics, Settings()), dynamics.model)


def gains(name: str, dynamics: Dynamics, settings: Settings) -> Array:
    """Numbers of a compiled controller as chosen by ``make_controller``."""
    return np.concatenate(_law(name, dynamics, settings).tuning)


def _law(name: str, dynamics: Dynamics, settings: Settings) -> Law:
    law: Law = make_controller(name, dynamics, settings).law  # type: ignore[attr-defined]
    return law
