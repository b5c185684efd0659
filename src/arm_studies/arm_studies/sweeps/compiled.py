# SPDX-License-Identifier: Apache-2.0
"""Controllers in compiled code, with their gains as inputs: the same code for all gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, Dynamics
from arm_dynamics.actuation.command_map import CommandMap
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.control.computed_torque import expression, held_gains
from arm_dynamics.control.factory import Settings
from arm_dynamics.control.joint_space import tuned
from arm_dynamics.equations import spring
from arm_dynamics.equations.tree import constant
from arm_dynamics.model.tree_builder import gravity_of, tree_of

type Torque = Callable[[ArmModel, ca.SX, ca.SX, Sequence[ca.SX], ca.SX, ca.SX, float], ca.SX]
"""Torque from model, q, v, desired (q, v, a), gains K_p and K_d, and the length of a tick."""

GAINS = ("bandwidth", "damping_ratio")
"""Settings that compiled controllers support; with others a run uses the Python controller."""


def _feedback(q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], kp: ca.SX, kd: ca.SX) -> ca.SX:
    return kp * (desired[0] - q) + kd * (desired[1] - v)


def _frictionless(model: ArmModel, q: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
    return spring.frictionless(model.springs, tree_of(model), q, v, a, gravity=gravity_of(model))


def _standing(model: ArmModel, q: ca.SX) -> ca.SX:
    still = ca.SX(model.n, 1)
    return _frictionless(model, q, still, still)


def _computed_torque(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], kp: ca.SX, kd: ca.SX, dt: float
) -> ca.SX:
    return expression(model, q, v, desired, (kp, kd, constant(np.array([dt]))))


def _pd(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], kp: ca.SX, kd: ca.SX, dt: float
) -> ca.SX:
    return _feedback(q, v, desired, kp, kd)


def _pd_gravity(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], kp: ca.SX, kd: ca.SX, dt: float
) -> ca.SX:
    return _standing(model, q) + _feedback(q, v, desired, kp, kd)


def _feed_forward(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], kp: ca.SX, kd: ca.SX, dt: float
) -> ca.SX:
    ahead = _frictionless(model, *desired) + constant(model.viscous) * desired[1]
    return ahead + _feedback(q, v, desired, kp, kd)


def _float(
    model: ArmModel, q: ca.SX, v: ca.SX, desired: Sequence[ca.SX], kp: ca.SX, kd: ca.SX, dt: float
) -> ca.SX:
    return _standing(model, q)


COMPILED: dict[str, Torque] = {
    "computed_torque": _computed_torque,
    "pd": _pd,
    "pd_gravity": _pd_gravity,
    "feed_forward": _feed_forward,
    "float": _float,
}
"""The same equations as those of the classes in ``arm_dynamics.control``, by name."""


def is_compiled(name: str, settings: Settings) -> bool:
    """Whether a controller with these settings runs in compiled code."""
    usual = Settings()
    return name in COMPILED and all(
        np.array_equal(getattr(settings, field.name), getattr(usual, field.name))
        for field in fields(Settings)
        if field.name not in (*GAINS, "dt")
    )


@one_at_a_time
def law(name: str, model: ArmModel, dt: float) -> ca.Function:
    """A controller for ``CompiledControl``.

    Args:
        name: One of ``COMPILED``.
        model: Its model.
        dt: Length of a tick in [s].

    Returns:
        CasADi function (x, r) -> command of shape (n,), r = (q_d, v_d, a_d, K_p, K_d).
    """
    n = model.n
    x, r = ca.SX.sym("x", 2 * n), ca.SX.sym("r", 5 * n)
    q, v = x[:n], x[n:]
    *desired, kp, kd = ca.vertsplit(r, n)
    tau = COMPILED[name](model, q, v, desired, kp, kd, dt)
    command = ca.densify(CommandMap(model)(q, v, tau))
    return ca.Function("law", [x, r], [command], {"cse": True})


def gains(name: str, dynamics: Dynamics, settings: Settings) -> Array:
    """K_p and K_d of a compiled controller as chosen by ``make_controller``, shape (2n,)."""
    tuning, n = (settings.bandwidth, settings.damping_ratio), dynamics.n
    if name == "computed_torque":
        return np.concatenate(held_gains(*tuning, n, settings.dt))
    if name == "float":
        return np.zeros(2 * n)
    return np.concatenate(tuned(dynamics, *tuning, dt=settings.dt))
