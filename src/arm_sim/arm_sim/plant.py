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
from arm_dynamics.scene_constraint import switchable
from arm_sim.contact_plant import ContactPlant, contact_plant
from arm_sim.parameters import Parameters
from arm_sim.projection import Constrained

# Above this many joints the mass matrix, of order n³ to factor, is never the shorter way.
DENSE_AT_MOST = 16

Law = Callable[[Tree, ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]


class Plant:
    """Equation of motion of one scene.

    With dry friction the equation depends on what each joint does, -1 and 1 for sliding that way,
    0 for sticking; these directions, one for each joint, follow the tunable quantities in p, and
    after them what each contact does.

    Attributes:
        model: The robot.
        parameters: What is tunable.
        acceleration: CasADi function (q, v, tau, p) -> q̈ of vectors of n.
        reaction: CasADi function (q, v, tau, p) -> torques that hold sticking joints, or None
            without dry friction; a scene with contacts has it in ``contact`` instead.
        contact: What contacts add, or None without any.
        project: CasADi function (x before a step, x after it, p) -> x after it, brought back to
            the constraints, or None without bilateral ones.
        rhs: CasADi function (x, u, p) -> x' with x = (q, v).
        method: Which algorithm turned out shorter, for people.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model = model
        self.parameters = Parameters(model)
        self.reaction: ca.Function | None = None
        self.contact: ContactPlant | None = None
        self.project: ca.Function | None = None
        if model.scene.bilateral:
            held = Constrained(model, Symbols(model, self.parameters))
            self.acceleration, self.project = held.acceleration, held.project
            self.method = "composite bodies and LDLᵀ, constraints held"
        elif model.scene.contacts:
            symbols = Symbols(model, self.parameters)
            self.contact = contact_plant(model, symbols, Joints(model, symbols.v))
            self.acceleration = self.contact.acceleration
            self.method = "composite bodies and LDLᵀ, contacts closed or apart"
        elif model.has_dry_friction:
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
        self._switches = ca.vertsplit(p["constraints"]) if "constraints" in p else []
        self._switchable = switchable(model.scene.constraints)
        self.viscous = friction.viscous(self.v, p.get("friction", constant(model.viscous)))

    def active(self, place: int) -> ca.SX | float:
        """1 or 0 for the constraint at a place of the scene's list: does it hold?"""
        places = self._switchable
        return 1.0 if place not in places else self._switches[places.index(place)]


class Joints:
    """What joints with dry friction do.

    Attributes:
        direction: Symbols: -1 and 1 for sliding that way, 0 for sticking; empty without friction.
        sliding: 1 for a joint that slides, 0 for one that sticks, shape (n,).
        friction: Dry friction of those that slide in [N m] or [N], shape (n,).
    """

    def __init__(self, model: ArmModel, v: ca.SX) -> None:
        n = model.n
        self.direction = ca.SX.sym("direction", n if model.has_dry_friction else 0)
        self.sliding, self.friction = ca.SX.ones(n), ca.SX(n, 1)
        if model.has_dry_friction:
            moves = [self.direction[i] ** 2 if s else 1 for i, s in enumerate(model.static)]
            self.sliding = ca.vertcat(*moves)
            dry = friction.dry(v, self.direction, *map(constant, model.sliding))
            self.friction = ca.sparsify(dry)


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
    joints = Joints(model, s.v)
    bias = rigid_body.inverse(s.tree, s.q, s.v, ca.SX(model.n, 1), s.gravity)
    M = rigid_body.mass_matrix(s.tree, s.q)
    a, reaction = sticking.forward(M, s.tau - bias - s.viscous - joints.friction, joints.sliding)
    arguments = [s.q, s.v, s.tau, ca.vertcat(s.p, joints.direction)]
    acceleration = ca.Function("acceleration", arguments, [a], {"cse": True})
    held = ca.Function("reaction", arguments, [ca.densify(reaction)], {"cse": True})
    return "composite bodies and LDLᵀ, sticking joints held", acceleration, held


def _algorithms(tree: Tree, n: int) -> list[tuple[str, Law]]:
    dense = ("composite bodies and LDLᵀ", rigid_body.forward_dense)
    recursive = ("articulated bodies", articulated.forward)
    if tree.has_followers:
        return [dense]
    return [recursive] if n > DENSE_AT_MOST else [dense, recursive]
