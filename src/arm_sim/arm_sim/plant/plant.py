# SPDX-License-Identifier: Apache-2.0
"""The scene's equation of motion as one function x' = f(x, u, p).

It contains only what the scene asks for.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property, partial

import casadi as ca
import numpy as np

from arm_dynamics import ArmModel
from arm_dynamics.actuation.internal_state import Ensemble
from arm_dynamics.actuation.joint_laws import laws_of
from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.equations.contact import ContactPoint
from arm_dynamics.equations.derivatives import inverse_derivatives
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST, algorithms
from arm_dynamics.model.loop_closure import Closure
from arm_sim.plant.bilateral import Bilateral
from arm_sim.plant.contact import ContactFunctions, contact_functions
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.response import AnyResponse, Response, response_of
from arm_sim.plant.symbols import Joints, Symbols, dense_function

_log = logging.getLogger(__name__)
Power = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
"""Function (q, v, tau, p) -> power in [W]."""


class Plant:
    """Equation of motion of one scene.

    With dry friction the equation depends on what each joint does, -1 and 1 for sliding that way,
    0 for sticking; these directions, one for each joint, follow the tunable quantities in p. So do
    joints at stops: 0 for one that a rigid stop holds, and after the directions which joints lean
    on compliant stops. Last comes what each contact does.

    Attributes:
        model: The robot.
        free: The same arm away from its stops, where nothing else makes events: shorter, with the
            tunable quantities alone in p. None where it has no stops, or is never without modes.
        parameters: What is tunable.
        laws: Drives and friction with states z of their own, or None if the scene has none.
        acceleration: CasADi function (q, v, tau, p) -> q̈ of vectors of n.
        project: CasADi function ((q, v) before a step, after it, p) -> (q, v) after it, brought
            back to the constraints, or None without bilateral ones.
        contact: What contacts add, or None without any.
        rhs: CasADi function (x, u, p) -> x' with x = (q, v, z).
        events: CasADi functions that the engine asks at events: ``loads`` (x, u, p), with
            bilateral constraints ``bilateral`` (x, u, p), with stops ``stop_torques`` (x, u, p),
            ``strike`` and ``pressures``, and with contacts ``contact_inertia`` (x, u, p),
            ``contact_geometry`` and ``contact_close``; empty where nothing sticks or touches.
        torques: CasADi function (x, u) -> torques that the drives, and all laws together, put on
            the links, or None where the command itself acts.
        method: Which algorithm turned out shorter, as text.
    """

    def __init__(self, model: ArmModel, stops: bool = True) -> None:
        """Compose the equations; without ``stops`` those of an arm that is never at one."""
        if model.n > DENSE_AT_MOST and stops:
            _log.info("writing the equations of %d joints", model.n)
        self.model = model
        self.parameters = Parameters(model)
        self.contact: ContactFunctions | None = None
        self.project: ca.Function | None = None
        self.stops = stops and bool(model.stops)
        always = model.has_dry_friction or bool(model.scene.contacts)
        self.free = Plant(model, stops=False) if self.stops and not always else None
        self._loads: tuple[ca.Function, ...] = ()
        self._of_joints: tuple[ca.Function, ...] = ()
        self.method = _method(Response.algorithm, model)
        s = Symbols(model, self.parameters)
        joints = Joints(model, s, stops)
        self._joints = s, joints
        self.directions, self.pressed = joints.direction.shape[0], joints.pressed.shape[0]
        self._stop_power = _stop_power(s, joints) if self.pressed else None
        held = Bilateral(model, s, joints) if model.scene.bilateral else None
        self.project = held.project(joints.p) if held else None
        response: AnyResponse
        if model.scene.contacts:
            response = dense = held or Response(model, s, joints)
            self.contact = contact_functions(model, s, joints, dense)
            self.acceleration, push = self.contact.acceleration, self.contact.push
            reaction = self.contact.reaction
            self._loads = self.contact.loads, self.contact.inertia
        elif self.directions or self.pressed:
            response = held or response_of(model, s, joints)
            self.method = _method(response.algorithm, model)
            self.acceleration, loads, reaction = _stick_slip(model, s, joints, response)
            self._loads, push = (loads,), ca.SX(model.n, 1)
        elif held:
            arguments, a = [s.q, s.v, s.tau, s.p], held.accelerations(held.load)
            self.acceleration = dense_function("acceleration", arguments, a)
        else:
            self.method, self.acceleration = _shortest(model, s)
        if held and self._loads:
            self._loads = (*self._loads, _bilateral(s, joints, held, push - reaction))
        if self._loads:
            jacobian = self.contact.jacobian if self.contact else ca.SX(0, model.n)
            self._strike = partial(_strike, s, joints, response, jacobian)
        if self.stops:
            self._loads = (*self._loads, _stop_torques(s, joints, reaction))
            pressures = (_pressures(s, joints),) if self.pressed else ()
            self._of_joints = (self.strike, *pressures)
        if self.free:
            self.method = self.free.method
        laws = laws_of(model)
        self._compose(Ensemble(laws, model.n) if laws else None)

    def accounted(self, ledger: Ensemble, powers: Sequence[Power]) -> Plant:
        """The same arm with laws whose last states integrate powers.

        The last of them is what friction of contacts and compliant stops take.
        """
        other = copy(self)
        other.free = self.free and self.free.accounted(ledger, powers)
        other._compose(ledger, [*powers, self._taken])
        return other

    def _taken(self, q: ca.SX, v: ca.SX, tau: ca.SX, p: ca.SX) -> ca.SX:
        """Power that friction of contacts and compliant stops take from the joints in [W]."""
        takers = [self.contact.lost] if self.contact else []
        takers += [self._stop_power] if self._stop_power else []
        return sum((taker(q, v, tau, p) for taker in takers), ca.SX(1, 1))

    def _compose(self, laws: Ensemble | None, powers: Sequence[Power] = ()) -> None:
        """Put laws, and with them powers as states more, around the arm."""
        self.laws = laws
        self.torques = _torques(laws) if laws else None
        n, a = self.model.n, self.acceleration
        self.rhs = _driven(a, laws, powers) if laws else _state_space(a, n)
        self.events = tuple(_of_state(function, laws, n) for function in self._loads)
        self.events = (*self.events, *self._of_joints)
        if self.contact:
            self.events = (*self.events, self.contact.geometry, self.contact.close)

    def scaled_jacobian(self) -> ca.Function | None:
        """The Jacobian of x' = (v, g) by x = (q, w), scaled so that it keeps a tree's zeros.

        With H v̇ = 1 · load for joints that are free, H v̇ = v̇ for those that are held and H ż = ż,
        H ∂v̇/∂x is the derivative of the torque that a given acceleration leaves over.

        Returns:
            CasADi function (x, u, p, x') -> H ∂g/∂q, H ∂g/∂w, H, sparse; or None for arms that
            are short, or held by more than their joints, where the Jacobian itself is as good.
        """
        tree, scene = self._joints[0].tree, self.model.scene
        if self.model.n <= DENSE_AT_MOST or scene.bilateral or scene.contacts:
            return None
        n, (s, joints) = self.model.n, self._joints
        x, u, p = (ca.SX.sym(name, self.rhs.size1_in(i)) for i, name in enumerate("xup"))
        slope = ca.SX.sym("slope", x.shape[0])
        q, v, z = split(x, n)
        tau = self.laws.equations(q, v, z, u).torque if self.laws else u
        load = s.tau - s.passive - joints.friction + joints.stop
        left = ca.Function("load", [s.q, s.v, s.tau, joints.p], [load])(q, v, tau, p)
        by_q, by_v, M = inverse_derivatives(tree, s.q, s.v, slope[n : 2 * n], s.gravity)
        inertial = ca.Function("inertial", [s.q, s.v, slope, joints.p], [by_q, by_v, M])
        by_q, by_v, M = inertial(q, v, slope, p)
        free = ca.Function("free", [joints.p], [ca.diag(joints.sliding)])(p)
        inertial_by_x = ca.horzcat(by_q, by_v, ca.SX(n, z.shape[0]))
        rows = ca.sparsify(free @ (ca.jacobian(left, x) - inertial_by_x))
        K = ca.vertcat(rows, ca.jacobian(self.rhs(x, u, p)[2 * n :], x))
        H = ca.diagcat(free @ M @ free + ca.SX.eye(n) - free, ca.SX.eye(z.shape[0]))
        found = [ca.sparsify(part) for part in (K[:, :n], K[:, n:], H)]
        return ca.Function("jacobian", [x, u, p, slope], found, {"cse": True})

    @cached_property
    def strike(self) -> ca.Function:
        """CasADi function of a blow in a scene with events.

        ((q, v), p, what held joints gain, impulses of contacts) -> velocities after it and the
        impulses that hold the held joints.
        """
        return self._strike()

    @cached_property
    def closure(self) -> Closure:
        """States that obey the bilateral constraints; for one thread only."""
        return Closure(self.model, self.model.stops)

    @property
    def points(self) -> tuple[ContactPoint, ...]:
        """The contacts."""
        return self.contact.points if self.contact else ()

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


def split(x: ca.SX, n: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    """q, v and z of a state."""
    return x[:n], x[n : 2 * n], x[2 * n :]


def _state_space(acceleration: ca.Function, n: int) -> ca.Function:
    """Function (x, u, p) -> x' with x = (q, v) from a function (q, v, tau, p) -> q̈."""
    x, u, p = _symbols(acceleration, 2 * n, n)
    q, v = x[:n], x[n:]
    return ca.Function("rhs", [x, u, p], [ca.vertcat(v, acceleration(q, v, u, p))], {"cse": True})


def _driven(acceleration: ca.Function, laws: Ensemble, powers: Sequence[Power]) -> ca.Function:
    """The same with laws between the command and the joints: x = (q, v, z), powers as states."""
    x, u, p = _symbols(acceleration, 2 * laws.n + len(laws.names), laws.n)
    q, v, z = split(x, laws.n)
    flow = laws.equations(q, v, z, u)
    more = [power(q, v, flow.torque, p) for power in powers]
    slopes = ca.vertcat(v, acceleration(q, v, flow.torque, p), flow.slope, *more)
    return dense_function("rhs", [x, u, p], slopes)


def _of_state(function: ca.Function, laws: Ensemble | None, n: int) -> ca.Function:
    """A function of (x, u, p) from one of (q, v, tau, p)."""
    x, u, p = _symbols(function, 2 * n + (len(laws.names) if laws else 0), n)
    q, v, z = split(x, n)
    tau = laws.equations(q, v, z, u).torque if laws else u
    return dense_function(function.name(), [x, u, p], *function.call([q, v, tau, p]))


def _torques(laws: Ensemble) -> ca.Function:
    """Function (x, u) -> what the drives, and all laws, put on the links."""
    x, u = ca.SX.sym("x", 2 * laws.n + len(laws.names)), ca.SX.sym("u", laws.n)
    q, v, z = split(x, laws.n)
    both = laws.drive(q, v, z, u), laws.equations(q, v, z, u).torque
    return dense_function("torques", [x, u], *both)


def _symbols(function: ca.Function, nx: int, n: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    return ca.SX.sym("x", nx), ca.SX.sym("u", n), ca.SX.sym("p", function.size1_in(3))


def _shortest(model: ArmModel, s: Symbols) -> tuple[str, ca.Function]:
    arguments = [s.q, s.v, s.tau, s.p]
    candidates = []
    for name, law in algorithms(s.tree, model.n):
        result = law(s.tree, s.q, s.v, s.tau - s.passive, s.gravity)
        candidates.append((name, ca.Function("acceleration", arguments, [result], {"cse": True})))
    return min(candidates, key=lambda candidate: operations(candidate[1]))


def _method(algorithm: str, model: ArmModel) -> str:
    """How accelerations are computed, and what holds the arm meanwhile, for people."""
    kinds = {
        "constraints held": model.scene.bilateral,
        "contacts closed or apart": model.scene.contacts,
        "sticking joints held": model.has_dry_friction,
    }
    return f"{algorithm}, {' and '.join(words for words, there in kinds.items() if there)}"


def _stick_slip(
    model: ArmModel, s: Symbols, joints: Joints, response: AnyResponse
) -> tuple[ca.Function, ca.Function, ca.SX]:
    """Acceleration, ``loads`` without contacts, and the loads of joints that are held."""
    a = response.accelerations(response.load)
    reaction = response.reactions(response.load, a)
    arguments = [s.q, s.v, s.tau, joints.p]
    held = model.friction.relative_hold(reaction, s.q, s.tau)
    none = ca.SX(0, 1)
    return (
        ca.Function("acceleration", arguments, [a], {"cse": True}),
        dense_function("loads", arguments, held, none, none, none),
        reaction,
    )


def _bilateral(s: Symbols, joints: Joints, held: Bilateral, push: ca.SX) -> ca.Function:
    """What the engine and recordings ask of bilateral constraints beside what else holds the arm.

    A function of how many motions of sliding joints they take away, and of the torques that
    contacts and friction at rest put on the joints beside them.
    """
    starting = ca.if_else(s.v == 0, joints.friction, 0)
    arguments = [s.q, s.v, s.tau, joints.p]
    return dense_function("bilateral", arguments, held.rank, push - starting)


def _strike(s: Symbols, joints: Joints, response: AnyResponse, jacobian: ca.SX) -> ca.Function:
    """See ``Plant.strike``; ``jacobian``: of the places of the contacts by q."""
    n, x = s.q.shape[0], ca.vertcat(s.q, s.v)
    change, impulse = ca.SX.sym("change", n), ca.SX.sym("impulse", jacobian.shape[0])
    gain, held = response.struck(jacobian.T @ impulse, change)
    return dense_function("strike", [x, joints.p, change, impulse], s.v + gain, held)


def _pressures(s: Symbols, joints: Joints) -> ca.Function:
    """``Joints.pressures`` of (q, v), which the engine asks where joints meet compliant stops."""
    return dense_function("pressures", [ca.vertcat(s.q, s.v)], joints.pressures)


def _stop_torques(s: Symbols, joints: Joints, reaction: ca.SX) -> ca.Function:
    """Torques with which stops push joints, those held by friction alone included."""
    arguments = [s.q, s.v, s.tau, joints.p]
    return dense_function("stop_torques", arguments, joints.stop - reaction)


def _stop_power(s: Symbols, joints: Joints) -> ca.Function:
    """Power that compliant stops take from the joints, some of which they may give back, [W]."""
    return dense_function("taken", [s.q, s.v, s.tau, joints.p], -ca.dot(joints.stop, s.v))
