# SPDX-License-Identifier: Apache-2.0
"""Accelerations of the joints under torques, and functions for events.

It contains only the terms that the scene has; drives and friction with states are added by the
plant.
"""

import logging

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST, algorithms
from arm_sim.plant.bilateral import Bilateral
from arm_sim.plant.contact import ContactFunctions
from arm_sim.plant.options import Options
from arm_sim.plant.response import AnyResponse, Reactions, Response, joint_reactions, response_of
from arm_sim.plant.symbols import Joints, Symbols, dense_function

_log = logging.getLogger(__name__)


class Mechanics:
    """Mechanics of the arm: from torques on its joints to their accelerations.

    Args:
        model: The robot.
        symbols: Its symbols.
        options: Options, of which stops, sliding and regularization are used.

    Attributes:
        symbols: Symbols of the expressions.
        joints: Modes of joints and contacts.
        acceleration: CasADi function (q, v, tau, p) -> q̈ of vectors of n.
        project: CasADi function ((q, v) before a step, after it, p) -> (q, v) after it, projected
            onto the constraints, and the residuals of positions and velocities before; None
            without bilateral constraints.
        contact: Functions of the contacts; None without any, and where nothing touches.
        method: Name of the selected algorithm, for display.
    """

    def __init__(self, model: ArmModel, symbols: Symbols, options: Options) -> None:
        if model.n > DENSE_AT_MOST and options.stops:
            _log.info("generating the equations of %d joints", model.n)
        self.symbols = s = symbols
        self.joints = joints = Joints(model, s, options)
        self._arguments = [s.q, s.v, s.tau, joints.p]
        self._has_stops = options.stops and bool(model.stops)
        self._bilateral = Bilateral(model, s, joints) if model.scene.bilateral else None
        self.project = self._bilateral.project(joints.p) if self._bilateral else None
        modes = joints.direction.numel() + joints.pressed.numel() + joints.switches.numel()
        self._eventful = not options.sliding and bool(modes or joints.contacts.numel())
        self.contact: ContactFunctions | None = None
        self._response: AnyResponse | None = None
        self._reactions: Reactions | None = None
        self.method, self.acceleration = self._solve(model, options)

    def _solve(self, model: ArmModel, options: Options) -> tuple[str, ca.Function]:
        """Find response and reactions; the algorithm, for display, and ``acceleration``."""
        s, joints = self.symbols, self.joints
        if not (self._bilateral or self._eventful or options.sliding):
            return _cheapest_dynamics(model, s)
        if joints.contacts.numel() and not options.sliding:
            self._response = response = self._bilateral or Response(model, s, joints)
            self.contact = ContactFunctions(model, s, joints, response)
            self._reactions = self.contact.reactions
        else:
            self._response = self._bilateral or response_of(model, s, joints)
            self._reactions = joint_reactions(s, self._response)
        acceleration = dense_function("acceleration", self._arguments, self._reactions.a)
        return _describe_method(self._response.algorithm, model), acceleration

    @built_once
    def event_functions(self) -> tuple[ca.Function, ...]:
        """CasADi functions (q, v, tau, p) that event handling evaluates.

        ``loads``, with contacts ``contact_mobility``, with bilateral constraints ``bilateral``,
        where parts may hold together ``statics``; none where nothing sticks or touches.
        """
        if (reactions := self._reactions) is None or not self._eventful:
            return ()
        functions = [self.contact.mobility] if self.contact else []
        functions.append(self._loads(reactions))
        if self._bilateral:
            functions.append(self._bilateral_torques(reactions, self._bilateral))
        parts = len(self.contact.points) if self.contact else 0
        if parts + bool(self.joints.direction.numel()) + bool(self._bilateral) > 1:
            functions.append(self._statics(reactions))
        return tuple(functions)

    def _loads(self, reactions: Reactions) -> ca.Function:
        """``Reactions.loads``, the torques of stops on the joints, and q̈.

        These torques include what friction alone may hold. Code that does not use them does not
        compute them.
        """
        stop_torques = self.joints.stop - reactions.held if self._has_stops else ca.SX(0, 1)
        results = *reactions.loads, stop_torques, reactions.a
        return dense_function("loads", self._arguments, *results)

    def _bilateral_torques(self, reactions: Reactions, bilateral: Bilateral) -> ca.Function:
        """What bilateral constraints need for event handling and recordings.

        The number of degrees of freedom of sliding joints that they remove, and the joint torques
        of contacts and static friction besides them.
        """
        starting = ca.if_else(self.symbols.v == 0, self.joints.friction, 0)
        torques = reactions.push - reactions.held - starting
        return dense_function("bilateral", self._arguments, bilateral.rank, torques)

    def _statics(self, reactions: Reactions) -> ca.Function:
        """The balance of forces, from which follows what holds together.

        The joint torques per force of a constraint and per unknown force of a contact, shape (n, m
        + 3 nc), the holding torques, the largest that dry friction bears forwards and backwards,
        shape (2 n,), and the constraints' accelerations at zero acceleration of the joints.
        """
        s, n = self.symbols, self.symbols.q.shape[0]
        A, drift = ca.SX(0, n), ca.SX(0, 1)
        if self._bilateral:
            A, drift = self._bilateral.rows.jacobian, self._bilateral.rows.drift
        forwards = ca.SX.ones(n)
        bears = [s.friction.most_held(way, s.q, s.tau) for way in (forwards, -forwards)]
        push = ca.horzcat(A.T, reactions.spread)
        results = push, reactions.held, ca.vertcat(*bears), drift
        return dense_function("statics", self._arguments, *results)

    @property
    def stop_functions(self) -> tuple[ca.Function, ...]:
        """Functions of stops: ``impact_map``, and of (q, v) ``pressures`` of compliant ones."""
        if not (self._eventful and self._has_stops):
            return ()
        if not self.joints.pressed.numel():
            return (self.impact_map,)
        x = ca.vertcat(self.symbols.q, self.symbols.v)
        return self.impact_map, dense_function("pressures", [x], self.joints.pressures)

    @built_once
    def impact_map(self) -> ca.Function:
        """CasADi function of an impact in a scene with events.

        ((q, v), p, velocity changes of held joints, impulses of contacts) -> velocities after it
        and the impulses on the held joints.
        """
        assert self._reactions and self._response, "a smooth scene has no impacts"
        s, jacobian = self.symbols, self._reactions.jacobian
        change, impulse = ca.SX.sym("change", s.q.numel()), ca.SX.sym("impulse", jacobian.shape[0])
        gain, held = self._response.impact(jacobian.T @ impulse, change)
        arguments = [ca.vertcat(s.q, s.v), self.joints.p, change, impulse]
        return dense_function("impact_map", arguments, s.v + gain, held)

    def power_lost(self, q: ca.SX, v: ca.SX, tau: ca.SX, p: ca.SX) -> ca.SX:
        """Power that contact friction and compliant stops take from the joints in [W]."""
        s, joints = self.symbols, self.joints
        losses = [self.contact.friction_power] if self.contact else []
        if joints.pressed.numel():
            losses.append(dense_function("stop_loss", self._arguments, -ca.dot(joints.stop, s.v)))
        return sum((power(q, v, tau, p) for power in losses), ca.SX(1, 1))


def _cheapest_dynamics(model: ArmModel, s: Symbols) -> tuple[str, ca.Function]:
    """Name and function of the algorithm of forward dynamics with the fewest operations."""
    arguments = [s.q, s.v, s.tau, s.p]
    candidates = []
    for name, law in algorithms(s.tree, model.n):
        result = law(s.tree, s.q, s.v, s.tau - s.passive, s.gravity)
        candidates.append((name, ca.Function("acceleration", arguments, [result], {"cse": True})))
    return min(candidates, key=lambda candidate: operations(candidate[1]))


def _describe_method(algorithm: str, model: ArmModel) -> str:
    """Description of the algorithm, and of the modes that it includes."""
    kinds = {
        "constraints held": model.scene.bilateral,
        "contacts closed or apart": model.scene.contacts,
        "sticking joints held": model.has_dry_friction,
    }
    return f"{algorithm}, {' and '.join(kind for kind, present in kinds.items() if present)}"
