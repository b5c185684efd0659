# SPDX-License-Identifier: Apache-2.0
"""The scene's equation of motion as one function x' = f(x, u, p).

It contains only the laws that the scene asks for.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel, SceneError
from arm_dynamics.actuation.internal_state import Ensemble
from arm_dynamics.actuation.joint_laws import laws_of
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.equations import rigid_body, sticking
from arm_dynamics.equations.forward_dynamics import algorithms
from arm_dynamics.equations.tree import gravity_of, tree_of
from arm_dynamics.model.arm import Array
from arm_dynamics.model.loop_closure import Closure
from arm_dynamics.scene.constraint import switchable
from arm_sim.plant.bilateral import Constrained
from arm_sim.plant.contact import ContactPlant, contact_plant
from arm_sim.plant.driven import driven, driven_reaction, torques
from arm_sim.plant.parameters import Parameters


class Plant:
    """Equation of motion of one scene.

    With dry friction the equation depends on what each joint does, -1 and 1 for sliding that way,
    0 for sticking; these directions, one for each joint, follow the tunable quantities in p, and
    after them what each contact does.

    Attributes:
        model: The robot.
        parameters: What is tunable.
        laws: Laws with states z of their own, or None if the scene asks for none.
        acceleration: CasADi function (q, v, tau, p) -> q̈ of vectors of n.
        reaction: CasADi function (q, w, u, p) -> torques that hold sticking joints, to be compared
            with the level at rest, with w = (v, z); None without dry friction. A scene with
            contacts has it in ``contact`` instead.
        contact: What contacts add, or None without any.
        project: CasADi function ((q, v) before a step, after it, p) -> (q, v) after it, brought
            back to the constraints, or None without bilateral ones.
        rhs: CasADi function (x, u, p) -> x' with x = (q, v, z).
        torques: CasADi function (x, u) -> torques that the drives, and all laws together, put on
            the links, or None where the command itself acts.
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
            self.contact = contact_plant(model, symbols, Joints(model, symbols))
            self.acceleration = self.contact.acceleration
            self.method = "composite bodies and LDLᵀ, contacts closed or apart"
        elif model.has_dry_friction:
            self.method, self.acceleration, self.reaction = _stick_slip(model, self.parameters)
        else:
            self.method, self.acceleration = _shortest(model, self.parameters)
        self.laws: Ensemble | None = None
        self.torques: ca.Function | None = None
        self.rhs = state_space(self.acceleration, model.n)
        self._held = self.reaction
        laws = laws_of(model)
        if laws and self.contact:
            raise SceneError(
                f"scene: contacts together with {laws[0].title} cannot be simulated; "
                "leave one of them out"
            )
        if laws:
            self._compose(Ensemble(laws, model.n))

    def with_laws(self, laws: Ensemble) -> Plant:
        """The same arm with other laws."""
        other = copy(self)
        other._compose(laws)
        return other

    def _compose(self, laws: Ensemble) -> None:
        self.laws, self.torques = laws, torques(laws)
        self.rhs = driven(self.acceleration, laws)
        self.reaction = self._held and driven_reaction(self._held, laws)

    @cached_property
    def closure(self) -> Closure:
        """States that obey the bilateral constraints; for one thread only."""
        return Closure(self.model)

    @property
    def nz(self) -> int:
        """How many states the laws have."""
        return len(self.laws.names) if self.laws else 0

    @property
    def nx(self) -> int:
        """Length of the state."""
        return 2 * self.model.n + self.nz

    @property
    def scale(self) -> Array:
        """Size that matters of each number of the state, for error control, shape (nx,)."""
        z = self.laws.scale if self.laws else np.zeros(0)
        return np.concatenate([np.ones(2 * self.model.n), z])

    def initial(self, q: Array, v: Array) -> Array:
        """The laws' states when the arm is put to q, v, shape (nz,)."""
        return self.laws.initial(q, v) if self.laws else np.zeros(0)

    def joint_torque(self, x: Array, u: Array) -> Array:
        """What the drives put on the joints in [N m] or [N]: the command, or a law's torque.

        Args:
            x: State, shape (nx,) or (k, nx).
            u: Command that acts, shape (n,) or (k, n).

        Returns:
            Torques of the shape of ``u``.
        """
        if self.torques is None or not u.size:
            return u
        torque: Array = np.array(self.torques(x.T, u.T)[0]).T
        return torque.reshape(u.shape)


class Symbols:
    """Symbols of one scene, and the pieces of its equation of motion that every variant shares."""

    def __init__(self, model: ArmModel, parameters: Parameters) -> None:
        p = parameters.symbols()
        self.q, self.v, self.tau = (ca.SX.sym(name, model.n) for name in ("q", "v", "tau"))
        self.p = ca.vertcat(ca.SX(0, 1), *p.values())
        self.tree = tree_of(model, ca.vertsplit(p["payload"], 10) if "payload" in p else None)
        self.gravity = p.get("gravity", gravity_of(model))
        self._switches = ca.vertsplit(p["constraints"]) if "constraints" in p else []
        self._switchable = switchable(model.scene.constraints)
        self.viscous = model.friction.smooth(self.v, p.get("friction"))
        if "external" in p:  # acts where friction does: on the link, behind limits and drives
            self.viscous -= p["external"]

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

    def __init__(self, model: ArmModel, s: Symbols) -> None:
        n = model.n
        self.direction = ca.SX.sym("direction", n if model.has_dry_friction else 0)
        self.sliding, self.friction = ca.SX.ones(n), ca.SX(n, 1)
        if model.has_dry_friction:
            levels = enumerate(model.friction.level)
            moves = [self.direction[i] ** 2 if level else 1 for i, level in levels]
            self.sliding = ca.vertcat(*moves)
            self.friction = ca.sparsify(model.friction.dry(s.v, self.direction, s.q, s.tau))


def state_space(acceleration: ca.Function, n: int) -> ca.Function:
    """Function (x, u, p) -> x' with x = (q, v) from a function (q, v, tau, p) -> q̈."""
    x, u, p = ca.SX.sym("x", 2 * n), ca.SX.sym("u", n), ca.SX.sym("p", acceleration.size1_in(3))
    q, v = x[:n], x[n:]
    return ca.Function("rhs", [x, u, p], [ca.vertcat(v, acceleration(q, v, u, p))], {"cse": True})


def _shortest(model: ArmModel, parameters: Parameters) -> tuple[str, ca.Function]:
    s = Symbols(model, parameters)
    arguments = [s.q, s.v, s.tau, s.p]
    candidates = []
    for name, law in algorithms(s.tree, model.n):
        result = law(s.tree, s.q, s.v, s.tau - s.viscous, s.gravity)
        candidates.append((name, ca.Function("acceleration", arguments, [result], {"cse": True})))
    return min(candidates, key=lambda candidate: operations(candidate[1]))


def _stick_slip(model: ArmModel, parameters: Parameters) -> tuple[str, ca.Function, ca.Function]:
    s = Symbols(model, parameters)
    joints = Joints(model, s)
    bias = rigid_body.inverse(s.tree, s.q, s.v, ca.SX(model.n, 1), s.gravity)
    M = rigid_body.mass_matrix(s.tree, s.q)
    a, reaction = sticking.forward(M, s.tau - bias - s.viscous - joints.friction, joints.sliding)
    arguments = [s.q, s.v, s.tau, ca.vertcat(s.p, joints.direction)]
    acceleration = ca.Function("acceleration", arguments, [a], {"cse": True})
    relative = model.friction.relative_hold(reaction, s.q, s.tau)
    held = ca.Function("reaction", arguments, [ca.densify(relative)], {"cse": True})
    return "composite bodies and LDLᵀ, sticking joints held", acceleration, held
