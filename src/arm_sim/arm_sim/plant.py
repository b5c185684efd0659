# SPDX-License-Identifier: Apache-2.0
"""The scene's equation of motion as one function x' = f(x, u, p).

It contains only the laws that the scene asks for.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.kernel import operations
from arm_dynamics.laws import articulated, friction, rigid_body, sticking
from arm_dynamics.laws.links import Tree, tree_of
from arm_sim.parameters import Parameters

# Above this many joints the mass matrix, of order n³ to factor, is never the shorter way.
DENSE_AT_MOST = 16

Law = Callable[[Tree, ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]


class Plant:
    """Equation of motion of one scene.

    With dry friction the equation depends on what each joint does, -1 and 1 for sliding that way,
    0 for sticking; these directions, one for each joint, follow the tunable quantities in p.

    Attributes:
        model: The robot.
        parameters: What is tunable.
        acceleration: CasADi function (q, v, tau, p) -> q̈ of vectors of n.
        reaction: CasADi function (q, v, tau, p) -> torques that hold sticking joints, or None
            without dry friction.
        rhs: CasADi function (x, u, p) -> x' with x = (q, v).
        method: Which algorithm turned out shorter, for people.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        self.parameters = Parameters(model)
        self.reaction: ca.Function | None = None
        if model.has_dry_friction:
            self.method, self.acceleration, self.reaction = _stick_slip(model, self.parameters)
        else:
            self.method, self.acceleration = _shortest(model, self.parameters)
        self.rhs = state_space(self.acceleration, model.n)

    @property
    def nx(self) -> int:
        """Length of the state."""
        return 2 * self.model.n


class Symbols:
    """Symbols of one scene, and the pieces of its equation of motion that every variant shares."""

    def __init__(self, model: ArmModel, parameters: Parameters) -> None:
        p = parameters.symbols()
        self.q, self.v, self.tau = (ca.SX.sym(name, model.n) for name in ("q", "v", "tau"))
        self.p = ca.vertcat(ca.SX(0, 1), *p.values())
        self.tree = tree_of(model, ca.vertsplit(p["payload"], 10) if "payload" in p else None)
        self.gravity = p.get("gravity", constant(model.scene.gravity))
        self.viscous = friction.viscous(self.v, p.get("friction", constant(model.viscous)))


def state_space(acceleration: ca.Function, n: int) -> ca.Function:
    """Function (x, u, p) -> x' with x = (q, v) from a function (q, v, tau, p) -> q̈."""
    x, u, p = ca.SX.sym("x", 2 * n), ca.SX.sym("u", n), ca.SX.sym("p", acceleration.size1_in(3))
    q, v = x[:n], x[n:]
    return ca.Function("rhs", [x, u, p], [ca.vertcat(v, acceleration(q, v, u, p))], {"cse": True})


def constant(values: object) -> ca.SX:
    """Numbers as an expression in which zeros vanish."""
    return ca.sparsify(ca.SX(ca.DM(np.array(values, dtype=float))))


def _shortest(model: ArmModel, parameters: Parameters) -> tuple[str, ca.Function]:
    s = Symbols(model, parameters)
    arguments = [s.q, s.v, s.tau, s.p]
    candidates = []
    for name, law in _algorithms(s.tree, model.n):
        result = law(s.tree, s.q, s.v, s.tau - s.viscous, s.gravity)
        candidates.append((name, ca.Function("acceleration", arguments, [result], {"cse": True})))
    return min(candidates, key=lambda candidate: operations(candidate[1]))


def _stick_slip(model: ArmModel, parameters: Parameters) -> tuple[str, ca.Function, ca.Function]:
    s = Symbols(model, parameters)
    direction = ca.SX.sym("direction", model.n)
    sliding = ca.vertcat(
        *[direction[i] ** 2 if level else 1 for i, level in enumerate(model.static)]
    )
    dry = friction.dry(s.v, direction, *map(constant, model.sliding))
    bias = rigid_body.inverse(s.tree, s.q, s.v, ca.SX(model.n, 1), s.gravity)
    M = rigid_body.mass_matrix(s.tree, s.q)
    a, reaction = sticking.forward(M, s.tau - bias - s.viscous - ca.sparsify(dry), sliding)
    arguments = [s.q, s.v, s.tau, ca.vertcat(s.p, direction)]
    acceleration = ca.Function("acceleration", arguments, [a], {"cse": True})
    held = ca.Function("reaction", arguments, [ca.densify(reaction)], {"cse": True})
    return "composite bodies and LDLᵀ, sticking joints held", acceleration, held


def _algorithms(tree: Tree, n: int) -> list[tuple[str, Law]]:
    dense = ("composite bodies and LDLᵀ", rigid_body.forward_dense)
    recursive = ("articulated bodies", articulated.forward)
    if tree.has_followers:
        return [dense]
    return [recursive] if n > DENSE_AT_MOST else [dense, recursive]
