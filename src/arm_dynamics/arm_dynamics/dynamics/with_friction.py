# SPDX-License-Identifier: Apache-2.0
"""Inverse and forward dynamics with friction, as functions of the vectors of one point."""

from __future__ import annotations

import casadi as ca

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.dynamics import compiled_terms as terms
from arm_dynamics.model.arm import ArmModel


def inverse(model: ArmModel, friction: SteadyFriction) -> ca.Function:
    """From q, v, a, a factor of each term, and gravity: torques without and with friction."""
    q, v, a = _symbols(model)
    chosen, gravity = ca.SX.sym("chosen", 5), ca.SX.sym("gravity", 3)
    inertia, coriolis, weight, _, spring = ca.vertsplit(chosen)
    tau = terms.INVERSE.expression(model)(q, coriolis * v, inertia * a, weight * gravity)
    tau += spring * terms.SPRING.expression(model)(q, v)
    sliding = ca.sign(v) if friction.has_dry else v
    return point([q, v, a, chosen, gravity], tau, friction.demanded(tau, v, sliding, q))


def forward(model: ArmModel, friction: SteadyFriction) -> ca.Function:
    """From q, v and tau: accelerations of joints that do not stick."""
    q, v, tau = _symbols(model)
    free = tau - friction(v, ca.sign(v), q, tau)
    free -= terms.SPRING.expression(model)(q, v)
    return point([q, v, tau], terms.FORWARD.expression(model)(q, v, free))


def point(given: list[ca.SX], *made: ca.SX) -> ca.Function:
    """A function of one point with dense results."""
    return ca.Function("point", given, [ca.densify(x) for x in made], {"cse": True})


def _symbols(model: ArmModel) -> list[ca.SX]:
    return [ca.SX.sym(name, model.n) for name in ("q", "v", "x")]
