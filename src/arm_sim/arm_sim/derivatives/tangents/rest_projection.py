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
        p_indices: Indices in p of the quantities to differentiate by.

    Attributes:
        begin_coefficients: CasADi function (x, u, p) -> coefficients c at the state in which a
            motion begins.
        project_begin: CasADi function (c, dx) -> dx with held joints and closed contacts at rest.
        end_coefficients: CasADi function (x at the beginning, x at the end, p) -> coefficients c,
            of an end that satisfies the contacts already.
        project_end: CasADi function (c, dx at the beginning, dx at the end) -> dx at the end, on
            closed contacts and anchors.
    """

    def __init__(self, plant: Plant, p_indices: Sequence[int] = ()) -> None:
        self._plant = plant
        self.begin_coefficients, self.project_begin = _begin(plant)
        self.end_coefficients, self.project_end = _end(plant)
        self._p_indices = p_indices

    def matrices(self) -> tuple[ca.Function, ...]:
        """The projections as derivatives of positions, velocities and internal states.

        ``at_rest`` (x, u, p) -> those of a state with which motion begins, and with contacts
        ``closing`` (x at the beginning, x at the end, p) -> those of ``project_end``, of positions
        and velocities by both ends.
        """
        n, nx = self._plant.model.n, self._plant.nx
        (x, u, p), dx = self.begin_coefficients.sx_in(), ca.SX.sym("dx", nx)
        begin = self.project_begin(self.begin_coefficients(x, u, p), dx)
        functions = [dense_function("at_rest", [x, u, p], ca.jacobian(begin, dx))]
        if self._plant.mechanics.contact:
            x, end, p = self.end_coefficients.sx_in()
            dbegin, dend, qv = ca.SX.sym("dbegin", nx), ca.SX.sym("dend", nx), slice(2 * n)
            closed_end = self.project_end(self.end_coefficients(x, end, p), dbegin, dend)[qv]
            slopes = (ca.jacobian(closed_end, by)[:, qv] for by in (dbegin, dend))
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
        slopes = ca.densify(ca.horzcat(*by_ends, jacobian_by(closed, p, self._p_indices)))
        return ca.Function("closed", [x, p, before], [slopes])


def _begin(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """``begin_coefficients`` and ``project_begin``."""
    n, c = plant.model.n, Coefficients()
    x, u, p = (ca.SX.sym(name, plant.rhs.size1_in(i)) for i, name in enumerate("xup"))
    dx = ca.SX.sym("dx", plant.nx)
    dq, dv, dz = ca.vertsplit(dx, [0, n, 2 * n, plant.nx])
    if plant.layout.directions:
        dq, dv = _stop_held(plant, c, (x, u, p), dq, dv)
    if plant.mechanics.contact:
        dv = _close_contacts(plant, c, x, p, ca.vertcat(dq, dv))
    projected = ca.densify(ca.vertcat(dq, dv, dz))
    return (
        ca.Function("begin_coefficients", [x, u, p], [c.values], {"cse": True}),
        ca.Function("project_begin", [c.symbols, dx], [projected], {"cse": True}),
    )


def _stop_held(
    plant: Plant, c: Coefficients, xup: tuple[ca.SX, ca.SX, ca.SX], dq: ca.SX, dv: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Changes of q and v without those of held joints, which act on the others as impulses."""
    (x, _, p), n = xup, plant.model.n
    change = ca.SX.sym("change", n)
    no_impulse = ca.SX(3 * len(plant.points), 1)
    v_after = plant.mechanics.impact_map(x[: 2 * n], p, change, no_impulse)[0]
    gain = ca.jacobian(v_after, change)  # in which the impact is linear
    held = plant.layout.parts(p)[1] == 0
    dv = dv - c.substitute(gain @ ca.diag(held)) @ dv
    if plant.model.stops.rigid.any():
        pressed = ca.logic_and(held, _pressed_at_rigid_stop(plant, *xup))
        dq = dq - c.substitute(gain @ ca.diag(pressed)) @ dq
    return dq, dv


def _close_contacts(plant: Plant, c: Coefficients, x: ca.SX, p: ca.SX, dqv: ca.SX) -> ca.SX:
    """Changes of v that closed contacts allow, from those of q and v."""
    n, contact = plant.model.n, plant.mechanics.contact
    assert contact is not None
    closed = ca.sum1(Mode.of(plant.layout.parts(p)[-1]).closed) > 0
    settled = contact.closing()(x[: 2 * n], p)[0]
    loose = ca.horzcat(ca.SX(n, n), ca.SX.eye(n))
    return c.substitute(ca.if_else(closed, settled, loose)) @ dqv


def _pressed_at_rigid_stop(plant: Plant, x: ca.SX, u: ca.SX, p: ca.SX) -> ca.SX:
    """1 for joints at rigid stops that friction alone would not hold there, else 0."""
    q, (lower, upper) = x[: plant.model.n], plant.model.stops.bounds
    load = plant.events["loads"](x, u, p)[0]
    push = ca.if_else(q <= lower, -load, ca.if_else(q >= upper, load, 0))
    return push > plant.model.friction.level


def _end(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """``end_coefficients`` and ``project_end``; without contacts nothing changes."""
    n, c = plant.model.n, Coefficients()
    names = ("begin", "end", "dbegin", "dend")
    begin, end, dbegin, dend = (ca.SX.sym(name, plant.nx) for name in names)
    p, projected = ca.SX.sym("p", plant.rhs.size1_in(2)), dend
    if contact := plant.mechanics.contact:
        before, after = begin[: 2 * n], end[: 2 * n]
        anchor = ca.vec(ca.reshape(contact.geometry(before)[0], 3, -1)[1:, :])
        by_end, by_anchor = ca.horzsplit(
            contact.closing()(after, p)[1], [0, 2 * n, 2 * n + anchor.shape[0]]
        )
        danchor = c.substitute(ca.jacobian(anchor, before)) @ dbegin[: 2 * n]
        anchor_change = c.substitute(by_anchor) @ danchor
        projected = ca.vertcat(c.substitute(by_end) @ dend[: 2 * n] + anchor_change, dend[2 * n :])
    return (
        ca.Function("end_coefficients", [begin, end, p], [c.values], {"cse": True}),
        ca.Function(
            "project_end", [c.symbols, dbegin, dend], [ca.densify(projected)], {"cse": True}
        ),
    )
