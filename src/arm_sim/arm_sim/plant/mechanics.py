# SPDX-License-Identifier: Apache-2.0
"""Accelerations of the joints under torques, and functions for events.

It contains only the terms that the scene has; drives and friction with states are added by the
plant.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import partial

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.codegen.kernel import operations
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST, algorithms
from arm_sim.plant.bilateral import Bilateral
from arm_sim.plant.contact import ContactFunctions, contact_functions
from arm_sim.plant.parameters import Parameters
from arm_sim.plant.response import AnyResponse, Response, response_of
from arm_sim.plant.symbols import Joints, Symbols, dense_function, has_cords

_log = logging.getLogger(__name__)


class Mechanics:
    """Mechanics of the arm: from torques on its joints to their accelerations.

    Args:
        model: The robot.
        parameters: Tunable quantities.
        stops: Whether joints may be at their stops, and comparisons are modes.
        drives: Symbols of the drives' modes.
        moving: Whether all joints slide and nothing touches, whatever the modes.
        smoothing: As for ``Joints``.

    Attributes:
        symbols: Symbols of the expressions.
        joints: Modes of joints and contacts.
        acceleration: CasADi function (q, v, tau, p) -> q̈ of vectors of n.
        project: CasADi function ((q, v) before a step, after it, p) -> (q, v) after it, projected
            onto the constraints; None without bilateral constraints.
        contact: Functions of the contacts; None without any.
        loads: CasADi functions (q, v, tau, p) that event handling evaluates: ``loads``, with
            contacts ``contact_inertia``, with bilateral constraints ``bilateral``, where parts may
            hold together ``statics``; empty where nothing sticks or touches.
        of_joints: Functions of positions and velocities: with stops ``strike``, with compliant
            stops ``pressures``.
        method: Name of the selected algorithm, for display.
    """

    def __init__(
        self,
        model: ArmModel,
        parameters: Parameters,
        stops: bool,
        drives: ca.SX,
        forward: Mapping[int, ca.SX],
        moving: bool = False,
        smoothing: float = 0.0,
    ) -> None:
        if model.n > DENSE_AT_MOST and stops:
            _log.info("generating the equations of %d joints", model.n)
        self.symbols = s = Symbols(model, parameters, stops, forward)
        cords = s.cords.modes if s.cords else ca.SX(0, 1)
        switches = ca.vertcat(cords, drives)
        self.joints = joints = Joints(model, s, stops, switches, moving, smoothing)
        self.contact: ContactFunctions | None = None
        self.loads: tuple[ca.Function, ...] = ()
        self.of_joints: tuple[ca.Function, ...] = ()
        self.method = _method(Response.algorithm, model)
        pressed, directed = joints.pressed.shape[0], joints.direction.shape[0]
        self._stop_power = _stop_power(s, joints) if pressed else None
        held = Bilateral(model, s, joints) if model.scene.bilateral else None
        self.project = held.project(joints.p) if held else None
        response: AnyResponse
        loads: Sequence[ca.SX] = ()
        if moving:
            self.acceleration = _stick_slip(
                model, s, joints, held or response_of(model, s, joints)
            )[0]
            return
        if model.scene.contacts:
            response = dense = held or Response(model, s, joints)
            self.contact = contact_functions(model, s, joints, dense)
            self.acceleration, push = self.contact.acceleration, self.contact.push
            reaction = self.contact.reaction
            loads, self.loads = self.contact.loads, (self.contact.inertia,)
        elif directed or pressed or joints.switches.numel() or (stops and has_cords(model)):
            response = held or response_of(model, s, joints)
            self.method = _method(response.algorithm, model)
            self.acceleration, loads, reaction = _stick_slip(model, s, joints, response)
            push = ca.SX(model.n, 1)
        elif held:
            arguments, a = [s.q, s.v, s.tau, s.p], held.accelerations(held.load)
            self.acceleration = dense_function("acceleration", arguments, a)
        else:
            self.method, self.acceleration = _shortest(model, s)
        if not loads:
            return
        stopped = joints.stop - reaction if stops and model.stops else ca.SX(0, 1)
        self.loads = (*self.loads, _loads(s, joints, loads, stopped))
        if held:
            self.loads = (*self.loads, _bilateral(s, joints, held, push - reaction))
        if len(model.scene.contacts) + bool(directed) + bool(held) > 1:
            self.loads = (*self.loads, _statics(model, s, joints, held, self.contact, reaction))
        jacobian = self.contact.jacobian if self.contact else ca.SX(0, model.n)
        self._strike = partial(_strike, s, joints, response, jacobian)
        if stops and model.stops:
            pressures = (_pressures(s, joints),) if pressed else ()
            self.of_joints = (self.strike, *pressures)

    @built_once
    def strike(self) -> ca.Function:
        """CasADi function of an impact in a scene with events, see ``Plant.strike``."""
        return self._strike()

    def taken(self, q: ca.SX, v: ca.SX, tau: ca.SX, p: ca.SX) -> ca.SX:
        """Power that contact friction and compliant stops take from the joints in [W]."""
        takers = [self.contact.lost] if self.contact else []
        takers += [self._stop_power] if self._stop_power else []
        return sum((taker(q, v, tau, p) for taker in takers), ca.SX(1, 1))


def _shortest(model: ArmModel, s: Symbols) -> tuple[str, ca.Function]:
    arguments = [s.q, s.v, s.tau, s.p]
    candidates = []
    for name, law in algorithms(s.tree, model.n):
        result = law(s.tree, s.q, s.v, s.tau - s.passive, s.gravity)
        candidates.append((name, ca.Function("acceleration", arguments, [result], {"cse": True})))
    return min(candidates, key=lambda candidate: operations(candidate[1]))


def _method(algorithm: str, model: ArmModel) -> str:
    """Description of the algorithm, and of the modes that it includes."""
    kinds = {
        "constraints held": model.scene.bilateral,
        "contacts closed or apart": model.scene.contacts,
        "sticking joints held": model.has_dry_friction,
    }
    return f"{algorithm}, {' and '.join(words for words, there in kinds.items() if there)}"


def _stick_slip(
    model: ArmModel, s: Symbols, joints: Joints, response: AnyResponse
) -> tuple[ca.Function, Sequence[ca.SX], ca.SX]:
    """Acceleration, loads without contacts, and the holding torques of held joints."""
    a = response.accelerations(response.load)
    reaction = response.reactions(response.load, a)
    arguments = [s.q, s.v, s.tau, joints.p]
    held = s.friction.relative_hold(reaction, s.q, s.tau)
    none = ca.SX(0, 1)
    return (
        ca.Function("acceleration", arguments, [a], {"cse": True}),
        (held, none, none, none, a),
        reaction,
    )


def _loads(s: Symbols, joints: Joints, loads: Sequence[ca.SX], stopped: ca.SX) -> ca.Function:
    """Function of ``ContactFunctions.loads`` with, before q̈, the torques of stops on the joints.

    They include what friction alone may hold. Code that does not ask for them does not compute
    them.
    """
    *others, a = loads
    return dense_function("loads", [s.q, s.v, s.tau, joints.p], *others, stopped, a)


def _bilateral(s: Symbols, joints: Joints, held: Bilateral, push: ca.SX) -> ca.Function:
    """Function of bilateral constraints for event handling and recordings.

    It returns the number of degrees of freedom of sliding joints that they remove, and the joint
    torques of contacts and static friction besides them.
    """
    starting = ca.if_else(s.v == 0, joints.friction, 0)
    arguments = [s.q, s.v, s.tau, joints.p]
    return dense_function("bilateral", arguments, held.rank, push - starting)


def _statics(
    model: ArmModel, s: Symbols, joints: Joints, held: Bilateral | None,
    contacts: ContactFunctions | None, reaction: ca.SX,
) -> ca.Function:  # fmt: skip
    """Function of the balance of forces, from which follows what holds together.

    It returns the joint torques per force of a constraint and per unknown force of a contact,
    shape (n, m + 3 nc), the holding torques, the largest that dry friction bears forwards and
    backwards, shape (2 n,), and the constraints' accelerations at zero acceleration of the joints.
    """
    n, arguments = model.n, [s.q, s.v, s.tau, joints.p]
    rows = held.rows.jacobian if held else ca.SX(0, n)
    drift = held.rows.drift if held else ca.SX(0, 1)
    push = ca.horzcat(rows.T, contacts.spread if contacts else ca.SX(n, 0))
    ways = ca.SX.ones(n), -ca.SX.ones(n)
    bears = [s.friction.most_held(way, s.q, s.tau) for way in ways]
    return dense_function("statics", arguments, push, reaction, ca.vertcat(*bears), drift)


def _strike(s: Symbols, joints: Joints, response: AnyResponse, jacobian: ca.SX) -> ca.Function:
    """See ``Plant.strike``; ``jacobian`` is that of the contact points by q."""
    n, x = s.q.shape[0], ca.vertcat(s.q, s.v)
    change, impulse = ca.SX.sym("change", n), ca.SX.sym("impulse", jacobian.shape[0])
    gain, held = response.struck(jacobian.T @ impulse, change)
    return dense_function("strike", [x, joints.p, change, impulse], s.v + gain, held)


def _pressures(s: Symbols, joints: Joints) -> ca.Function:
    """``Joints.pressures`` of (q, v), evaluated where joints meet compliant stops."""
    return dense_function("pressures", [ca.vertcat(s.q, s.v)], joints.pressures)


def _stop_power(s: Symbols, joints: Joints) -> ca.Function:
    """Power that compliant stops take from the joints, partly recoverable, in [W]."""
    return dense_function("taken", [s.q, s.v, s.tau, joints.p], -ca.dot(joints.stop, s.v))
