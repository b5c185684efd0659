# SPDX-License-Identifier: Apache-2.0
"""The equation of motion with laws between the command and the joints: x = (q, v, z)."""

from __future__ import annotations

import casadi as ca

from arm_dynamics.actuation.internal_state import Ensemble


def driven(acceleration: ca.Function, laws: Ensemble) -> ca.Function:
    """Compose the state-space function of an arm with laws.

    Args:
        acceleration: Function (q, v, tau, p) -> q̈.
        laws: What acts on the joints.

    Returns:
        Function ``rhs`` (x, u, p) -> x' with x = (q, v, z).
    """
    x, u, p = _symbols(acceleration, laws)
    q, v, z = split(x, laws.n)
    flow = laws.equations(q, v, z, u)
    slopes = ca.vertcat(v, acceleration(q, v, flow.torque, p), flow.slope)
    return ca.Function("rhs", [x, u, p], [ca.densify(slopes)], {"cse": True})


def driven_reaction(reaction: ca.Function, laws: Ensemble) -> ca.Function:
    """The same for the torques that hold sticking joints: (q, w, u, p) with w = (v, z)."""
    x, u, p = _symbols(reaction, laws)
    q, v, z = split(x, laws.n)
    held = reaction(q, v, laws.equations(q, v, z, u).torque, p)
    return ca.Function("reaction", [q, x[laws.n :], u, p], [held], {"cse": True})


def torques(laws: Ensemble) -> ca.Function:
    """Function ``torques`` (x, u) -> what the drives, and all laws, put on the links."""
    x, u = ca.SX.sym("x", 2 * laws.n + len(laws.names)), ca.SX.sym("u", laws.n)
    q, v, z = split(x, laws.n)
    results = [laws.drive(q, v, z, u), laws.equations(q, v, z, u).torque]
    return ca.Function("torques", [x, u], [ca.densify(r) for r in results], {"cse": True})


def split(x: ca.SX, n: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    """q, v and z of a state."""
    return x[:n], x[n : 2 * n], x[2 * n :]


def _symbols(function: ca.Function, laws: Ensemble) -> tuple[ca.SX, ca.SX, ca.SX]:
    x = ca.SX.sym("x", 2 * laws.n + len(laws.names))
    return x, ca.SX.sym("u", laws.n), ca.SX.sym("p", function.size1_in(3))
