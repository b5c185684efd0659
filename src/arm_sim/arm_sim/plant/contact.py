# SPDX-License-Identifier: Apache-2.0
"""Equation of motion of a scene with contacts, and functions for its events.

The modes of joints with dry friction and of contacts are at the end of p; see ``plant.response``
and ``equations.contact``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations import contact
from arm_dynamics.equations.contact import ContactPoint, Delassus, Mode
from arm_dynamics.model.tree_builder import contact_points, tree_of
from arm_sim.plant.response import Response
from arm_sim.plant.symbols import Joints, Symbols, dense_function


@dataclass(frozen=True)
class ContactFunctions:
    """Functions of a scene with nc contacts; ``place`` and the like are of shape (3 nc,).

    Attributes:
        points: The contacts.
        acceleration: (q, v, tau, p) -> q̈.
        loads: Holding torques of sticking joints relative to what friction bears, forces and
            accelerations of the points, acceleration of each gap per normal force where it
            closes (grip), and q̈: expressions.
        inertia: (q, v, tau, p) -> acceleration of the points per force on them, of the joints per
            force, and of the points without contact forces.
        geometry: (q, v) stacked -> positions of the points in their planes' axes, velocities
            likewise, sizes.
        close: ((q, v) stacked, p, anchor) -> (q, v) projected onto closed gaps and the anchors of
            sticking points, nearest in the metric of M; one Newton step. A ball has no anchor.
        settle: ((q, v) stacked, p) -> velocities compatible with the closed contacts, after an
            impulse along their forces.
        sites: q -> normal, two tangents and contact point of each contact in the world frame, in
            [m], shape (3, 4 nc).
        push: Joint torques of the contacts, an expression.
        spread: Joint torques per unknown force, likewise, shape (n, 3 nc); zero in modes without
            that force.
        reaction: Holding torques of held joints, likewise.
        jacobian: Velocities of the points per velocity of the joints, likewise, shape (3 nc, n).
        lost: (q, v, tau, p) -> power dissipated by friction of the contacts in [W].
        slopes: Builds (q, v, tau, p, q̈, force) -> derivatives of the torques of the forces and of
            the accelerations of the active rows by q and v, both forces and q̈ being constant,
            these rows, accelerations of the joints per unknown force, and minus the unknown
            forces per acceleration of the rows.
        closing: Builds ((q, v) stacked, p) -> derivatives of ``settle`` by q and v, and of
            ``close``, repeated, by q, v and anchors, where the contacts are satisfied already.
    """

    points: tuple[ContactPoint, ...]
    acceleration: ca.Function
    loads: Sequence[ca.SX]
    inertia: ca.Function
    geometry: ca.Function
    close: ca.Function
    settle: ca.Function
    sites: ca.Function
    push: ca.SX
    spread: ca.SX
    reaction: ca.SX
    jacobian: ca.SX
    lost: ca.Function
    slopes: Callable[[], ca.Function]
    closing: Callable[[], ca.Function]


def gaps(model: ArmModel, points: tuple[ContactPoint, ...]) -> ca.Function:
    """CasADi function q -> heights of contact points above their planes in [m], shape (nc,)."""
    q = ca.SX.sym("q", model.n)
    place = contact.geometry(tree_of(model), list(points), q).place
    return ca.Function("gaps", [q], [place[::3]])


def contact_functions(
    model: ArmModel, s: Symbols, joints: Joints, response: Response
) -> ContactFunctions:
    """Build the functions of a scene with contacts.

    Args:
        model: The robot.
        s: Its symbols.
        joints: Modes of the joints.
        response: Their response to forces.

    Returns:
        The functions.
    """
    points = contact_points(model)
    anchor = ca.SX.sym("anchor", 2 * len(points))
    mode, S = Mode.of(joints.contacts), ca.diag(joints.sliding)
    where = contact.geometry(s.tree, points, s.q)
    A = where.rows
    speed = A @ s.v
    # After many revolutions, the rounding of a joint's position also enters the gap.
    size = where.size + ca.fabs(A[::3, :]) @ ca.fabs(s.q)
    A_moving = ca.sparsify(A @ S)
    B = response.mobility(A.T)
    a_free = response.accelerations(response.load)
    free = A_moving @ a_free + ca.jtimes(speed, s.q, s.v)
    delassus, shares = Delassus(A_moving, B), contact.shares(points, speed, mode)
    force = delassus.forces(free, shares, mode.rows())
    a = a_free + B @ force
    push = A.T @ force
    held = response.reactions(response.load + push, a)
    reaction = s.friction.relative_hold(held, s.q, s.tau)
    x = ca.vertcat(s.q, s.v)
    arguments = [s.q, s.v, s.tau, joints.p]
    returning = mode.rows() * contact.positional(points)
    expected = ca.vec(ca.vertcat(ca.SX(1, len(points)), ca.reshape(anchor, 2, -1)))
    closed = ca.vertcat(
        s.q + B @ delassus.forces(where.place - expected, ca.diag(returning), returning),
        s.v + B @ delassus.forces(A_moving @ s.v, ca.diag(mode.rows()), mode.rows()),
    )
    settled = s.v + B @ delassus.forces(speed, shares, mode.rows())
    accelerations = delassus.accelerations(force) + free

    @one_at_a_time
    def slopes() -> ca.Function:
        acting, given, rows = ca.SX.sym("a", model.n), ca.SX.sym("f", A.shape[0]), mode.rows()
        torque = S @ A.T @ (shares @ (rows * given))
        rates = rows * (A_moving @ acting + ca.jtimes(speed, s.q, s.v))
        slopes = (ca.sparsify(ca.jacobian(of, x)) for of in (torque, rates))
        solved = ca.diag(rows) @ A_moving, B @ shares, -delassus.unknowns(shares, rows)
        return ca.Function("slopes", [*arguments, acting, given], [*slopes, *solved])

    @one_at_a_time
    def closing() -> ca.Function:
        by_q, no = ca.jacobian(where.place, s.q), ca.SX(model.n, model.n)
        drift = ca.horzcat(ca.jacobian(speed, s.q), A)
        back = B @ delassus.unknowns(ca.diag(returning), returning)
        settled = B @ shares @ delassus.unknowns(shares, mode.rows()) @ -drift
        held = B @ delassus.unknowns(ca.diag(mode.rows()), mode.rows())
        turned, eye = held @ ca.jacobian(A_moving @ s.v, s.q), ca.SX.eye(model.n)
        tangents = [i for i in range(A.shape[0]) if i % 3]
        moved = ca.horzcat(eye - back @ by_q, no, back[:, tangents])
        follows = ca.horzcat(no, eye - held @ A_moving, ca.SX(model.n, len(tangents)))
        closed = ca.vertcat(moved, follows - turned @ moved)
        return dense_function("closing", [x, joints.p], ca.horzcat(no, eye) + settled, closed)

    grip = contact.grips(points, delassus.W, speed, mode)
    return ContactFunctions(
        tuple(points),
        dense_function("acceleration", arguments, a),
        (reaction, force, accelerations, grip, a),
        dense_function("contact_inertia", arguments, delassus.W, B, free),
        dense_function("contact_geometry", [x], where.place, speed, size),
        dense_function("contact_close", [x, joints.p, anchor], closed),
        dense_function("contact_settle", [x, joints.p], settled),
        ca.Function("contact_sites", [s.q], [contact.sites(s.tree, points, s.q)], {"cse": True}),
        push,
        A.T @ shares,
        held,
        A,
        dense_function("lost", arguments, _lost(force, speed)),
        slopes,
        closing,
    )


def _lost(force: ca.SX, speed: ca.SX) -> ca.SX:
    tangential = [i for i in range(force.shape[0]) if i % 3]
    return -ca.dot(force[tangential], speed[tangential])
