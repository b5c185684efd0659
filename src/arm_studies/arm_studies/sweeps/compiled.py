# SPDX-License-Identifier: Apache-2.0
"""Controllers in compiled code, with their gains as inputs: the same code for all gains."""

from __future__ import annotations

from dataclasses import fields

import casadi as ca
import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.control.compiled_law import command_function
from arm_dynamics.control.factory import Settings, make_controller
from arm_dynamics.control.law import Law

# Controllers without memory that are compiled into the simulation.
COMPILED = ("computed_torque", "pd", "pd_gravity", "feed_forward", "float")

# Settings that compiled controllers support; with others a run uses the Python controller.
GAINS = ("dt", "bandwidth", "damping_ratio")


def is_compiled(name: str, settings: Settings) -> bool:
    """Whether a controller with these settings runs in compiled code."""
    usual = Settings()
    return name in COMPILED and all(
        np.array_equal(getattr(settings, field.name), getattr(usual, field.name))
        for field in fields(Settings)
        if field.name not in GAINS
    )


def law(name: str, dynamics: Dynamics) -> ca.Function:
    """One of ``COMPILED`` for ``CompiledControl``; numbers of r as of ``gains``."""
    return command_function(_formula(name, dynamics, Settings()), dynamics.model)


def gains(name: str, dynamics: Dynamics, settings: Settings) -> Array:
    """Numbers of a compiled controller as chosen by ``make_controller``."""
    return np.concatenate(_formula(name, dynamics, settings).tuning)


def _formula(name: str, dynamics: Dynamics, settings: Settings) -> Law:
    law: Law = make_controller(name, dynamics, settings).law  # type: ignore[attr-defined]
    return law
