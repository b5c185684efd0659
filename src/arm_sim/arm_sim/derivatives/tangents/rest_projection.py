# SPDX-License-Identifier: Apache-2.0
"""Projection of state changes onto the motions that held joints and closed contacts allow.

A held joint that is given a small velocity stops at once; the reaction of its friction or stop
acts on the other joints as an impulse. That is the projection onto the motions that the modes
allow, along the forces that hold. Positions are projected alike at a rigid stop against which the
load presses a joint: displaced, it is led back.
"""

from collections.abc import Sequence

import casadi as ca

from arm_dynamics.codegen.one_at_a_time import built_once
from arm_dynamics.equations.contact import Mode
from arm_sim.coefficients import Coefficients
from arm_sim.plant.plant import Plant
from arm_sim.plant.symbols import dense_function, jacobian_by

CLOSING_STEPS = 2  # of the projection onto closed contacts, see ``native/events/closing.h``


class RestProjection:
    """Projections at the beginning and at the end of a motion in a scene with events.

    Args:
        plant: The scene's equations.
        tuned: Places in p of the quantities to differentiate by.

    Attributes:
        rest_begin: CasADi function (x, u, p) -> coefficients c at the state in which a motion
            begins.
        begin_at_rest: CasADi function (c, dx) -> dx with held joints and closed contacts at rest.
        rest_end: CasADi function (x at the beginning, x at the end, p) -> coefficients c, of an
            end that satisfies the contacts already.
        end_at_rest: CasADi function (c, dx at the beginning, dx at the end) -> dx at the end, on
            closed contacts and anchors.
    """

    def __init__(self, plant: Plant, tuned: Sequence[int] = ()) -> None:
        self._plant = plant
        self.rest_begin, self.begin_at_rest = _beginning(plant)
        self.rest_end, self.end_at_rest = _end(plant)
        self._tuned = tuned

    def matrices(self) -> tuple[ca.Function, ...]:
        """The projections as derivatives of positions, velocities and internal states.

        ``at_rest`` (x, u, p) -> those of a state with which motion begins, and with contacts
        ``closing`` (x at the beginning, x at the end, p) -> those of ``rest_end``, of positions
        and velocities by both ends.
        """
        n, nx = self._plant.model.n, self._plant.nx
        (x, u, p), dx = self.rest_begin.sx_in(), ca.SX.sym("dx", nx)
        moved = self.begin_at_rest(self.rest_begin(x, u, p), dx)
        functions = [dense_function("at_rest", [x, u, p], ca.jacobian(moved, dx))]
        if self._plant.mechanics.contact:
            x, end, p = self.rest_end.sx_in()
            dbegin, dend, qv = ca.SX.sym("dbegin", nx), ca.SX.sym("dend", nx), slice(2 * n)
            moved = self.end_at_rest(self.rest_end(x, end, p), dbegin, dend)[qv]
            slopes = (ca.jacobian(moved, by)[:, qv] for by in (dbegin, dend))
            functions.append(dense_function("closing", [x, end, p], *slopes))
        return tuple(functions)

    @built_once
    def closed(self) -> ca.Function:
        """Derivatives of the closing of contacts at any end.

        CasADi function ((q, v) at the end, p, (q, v) at the beginning) -> derivatives of (q, v)
        with closed contacts by those at the beginning, at the end, and by quantities, side by
        side, shape (2 n, 4 n + nt).
        """
        contact, n = self._plant.mechanics.contact, self._plant.model.n
        assert contact is not None
        x, p = ca.MX.sym("x", 2 * n), ca.MX.sym("p", self._plant.rhs.numel_in(2))
        before = ca.MX.sym("before", 2 * n)
        place, closed = ca.reshape(contact.geometry(before)[0], 3, -1), x
        for _ in range(CLOSING_STEPS):
            closed = contact.close(closed, p, ca.vec(place[1:, :]))
        by_ends = (ca.jacobian(closed, by) for by in (before, x))
        slopes = ca.densify(ca.horzcat(*by_ends, jacobian_by(closed, p, self._tuned)))
        return ca.Function("closed", [x, p, before], [slopes])


def _beginning(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """``rest_begin`` and ``begin_at_rest``."""
    n, c = plant.model.n, Coefficients()
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    dx = ca.SX.sym("dx", plant.nx)
    dq, dv, dz = ca.vertsplit(dx, [0, n, 2 * n, plant.nx])
    qv, (_, direction, *_, contacts) = x[: 2 * n], plant.layout.parts(p)
    if plant.layout.directions:
        change = ca.SX.sym("change", n)
        struck = plant.mechanics.impact_map(qv, p, change, ca.SX(3 * len(plant.points), 1))[0]
        gain = ca.jacobian(struck, change)  # which is linear in it
        held = direction == 0
        dv = dv - c.substitute(gain @ ca.diag(held)) @ dv
        if plant.model.stops.rigid.any():
            back = ca.logic_and(held, _leans(plant, x, u, p))
            dq = dq - c.substitute(gain @ ca.diag(back)) @ dq
    if plant.mechanics.contact:
        closed = ca.sum1(Mode.of(contacts).closed) > 0
        settled = plant.mechanics.contact.closing()(qv, p)[0]
        loose = ca.horzcat(ca.SX(n, n), ca.SX.eye(n))
        dv = c.substitute(ca.if_else(closed, settled, loose)) @ ca.vertcat(dq, dv)
    moved = ca.densify(ca.vertcat(dq, dv, dz))
    return (
        ca.Function("rest_begin", [x, u, p], [c.values], {"cse": True}),
        ca.Function("begin_at_rest", [c.symbols, dx], [moved], {"cse": True}),
    )


def _leans(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
    """Joints at rigid stops that friction alone would not hold there."""
    q, (lower, upper) = x[: plant.model.n], plant.model.stops.bounds
    load = plant.events["loads"](x, u, p)[0]
    push = ca.if_else(q <= lower, -load, ca.if_else(q >= upper, load, 0))
    return push > plant.model.friction.level


def _end(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """``rest_end`` and ``end_at_rest``; without contacts nothing changes."""
    n, c = plant.model.n, Coefficients()
    names = ("begin", "end", "dbegin", "dend")
    begin, end, dbegin, dend = (ca.SX.sym(name, plant.nx) for name in names)
    p, moved = ca.SX.sym("p", plant.rhs.size1_in(2)), dend
    if contact := plant.mechanics.contact:
        before, after = begin[: 2 * n], end[: 2 * n]
        anchor = ca.vec(ca.reshape(contact.geometry(before)[0], 3, -1)[1:, :])
        by_end, by_anchor = ca.horzsplit(
            contact.closing()(after, p)[1], [0, 2 * n, 2 * n + anchor.shape[0]]
        )
        danchor = c.substitute(ca.jacobian(anchor, before)) @ dbegin[: 2 * n]
        back = c.substitute(by_anchor) @ danchor
        moved = ca.vertcat(c.substitute(by_end) @ dend[: 2 * n] + back, dend[2 * n :])
    return (
        ca.Function("rest_end", [begin, end, p], [c.values], {"cse": True}),
        ca.Function("end_at_rest", [c.symbols, dbegin, dend], [ca.densify(moved)], {"cse": True}),
    )
