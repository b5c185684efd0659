# SPDX-License-Identifier: Apache-2.0
"""Controllers in compiled code, with their gains as inputs: the same code for all gains."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.factory import Settings, make_controller
from arm_dynamics.model.rigid_expressions import RigidExpressions
from arm_dynamics.trajectory.reference import Reference

COMPILED = ("computed_torque", "pd", "pd_gravity", "feed_forward", "float")
"""Controllers without memory that are compiled into the simulation."""

GAINS = ("dt", "bandwidth", "damping_ratio")
"""Settings that compiled controllers support; with others a run uses the Python controller."""


def is_compiled(name: str, settings: Settings) -> bool:
    """Whether a controller with these settings runs in compiled code."""
    usual = Settings()
    return name in COMPILED and all(
        np.array_equal(getattr(settings, field.name), getattr(usual, field.name))
        for field in fields(Settings)
        if field.name not in GAINS
    )


@one_at_a_time
def law(name: str, dynamics: Dynamics) -> ca.Function:
    """A controller for ``CompiledControl``.

    Args:
        name: One of ``COMPILED``.
        dynamics: Its model.

    Returns:
        CasADi function (x, r) -> command of shape (n,), r = (q_d, v_d, a_d, numbers as of
        ``gains``).
    """
    made, n = _formula(name, dynamics, Settings()), dynamics.n
    x, desired = ca.SX.sym("x", 2 * n), ca.SX.sym("desired", 3 * n)
    tuning = [ca.SX.sym("tuning", part.size) for part in made.tuning]
    (q, v), (q_d, v_d, a_d) = ca.vertsplit(x, n), ca.vertsplit(desired, n)
    reference = Reference(q_d, v_d, a_d, ca.SX(n, 1))
    tau, _ = made.formula(RigidExpressions(dynamics.model), q, v, reference, tuning, ())
    command = ca.densify(CommandMap(dynamics.model)(q, v, tau))
    return ca.Function("law", [x, ca.vertcat(desired, *tuning)], [command], {"cse": True})


def gains(name: str, dynamics: Dynamics, settings: Settings) -> Array:
    """Numbers of a compiled controller as chosen by ``make_controller``."""
    return np.concatenate(_formula(name, dynamics, settings).tuning)


def _formula(name: str, dynamics: Dynamics, settings: Settings) -> Any:
    """The controller as a ``control.Law``."""
    return make_controller(name, dynamics, settings).law  # type: ignore[attr-defined]
