# SPDX-License-Identifier: Apache-2.0
"""Equation of motion of a scene with contacts, and functions for its events.

The modes of joints with dry friction and of contacts are at the end of p; see ``plant.response``
and ``equations.contact``.
"""

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.codegen.one_at_a_time import built_once, one_at_a_time
from arm_dynamics.equations import contact
from arm_dynamics.equations.contact import Delassus, Mode
from arm_dynamics.model.tree_builder import contact_points
from arm_sim.plant.response import Reactions, Response
from arm_sim.plant.symbols import Joints, Symbols, dense_function


class ContactFunctions:
    """Functions of a scene with nc contacts; ``place`` and the like are of shape (3 nc,).

    Args:
        model: The robot.
        s: Its symbols.
        joints: Modes of the joints.
        response: Response of the joints to forces.

    Attributes:
        points: The contacts.
    """

    def __init__(self, model: ArmModel, s: Symbols, joints: Joints, response: Response) -> None:
        self.points = contact_points(model)
        self._s, self._p, self._response = s, joints.p, response
        self._mode, self._sliding = Mode.of(joints.contacts), ca.diag(joints.sliding)
        self._arguments, self._x = [s.q, s.v, s.tau, joints.p], ca.vertcat(s.q, s.v)
        self._geometry = contact.geometry(s.tree, self.points, s.q)
        A = self._geometry.rows
        self._speed = A @ s.v
        self._A_moving = ca.sparsify(A @ self._sliding)
        self._B = response.mobility(A.T)
        contact_free = response.accelerations(response.load)
        self._free = self._A_moving @ contact_free + ca.jtimes(self._speed, s.q, s.v)
        self._delassus = Delassus(self._A_moving, self._B)
        self._shares = contact.shares(self.points, self._speed, self._mode)
        self._force = self._delassus.forces(self._free, self._shares, self._mode.rows())
        self._a = contact_free + self._B @ self._force

    @property
    def reactions(self) -> Reactions:
        """Forces of contacts and held joints, as expressions."""
        A, delassus = self._geometry.rows, self._delassus
        push = A.T @ self._force
        held = self._response.reactions(self._response.load + push, self._a)
        relative = self._s.friction.relative_hold(held, self._s.q, self._s.tau)
        accelerations = delassus.accelerations(self._force) + self._free
        grip = contact.grips(self.points, delassus.W, self._speed, self._mode)
        loads = relative, self._force, accelerations, grip
        return Reactions(self._a, loads, held, push, A.T @ self._shares, A)

    @property
    def mobility(self) -> ca.Function:
        """``contact_mobility`` (q, v, tau, p) -> mobility, and motion without contact forces.

        These are the Delassus matrix, which is the acceleration of the points per force on them;
        the acceleration of the joints per force; and that of the points without contact forces.
        """
        results = self._delassus.W, self._B, self._free
        return dense_function("contact_mobility", self._arguments, *results)

    @built_once
    def geometry(self) -> ca.Function:
        """(q, v) stacked -> positions of the points in their planes' axes, velocities, sizes."""
        # After many revolutions, the rounding of a joint's position also enters the gap.
        travel = ca.fabs(self._geometry.rows[::3, :]) @ ca.fabs(self._s.q)
        results = self._geometry.place, self._speed, self._geometry.size + travel
        return dense_function("contact_geometry", [self._x], *results)

    @built_once
    def close(self) -> ca.Function:
        """((q, v) stacked, p, anchor) -> (q, v) projected onto closed contacts.

        Onto closed gaps and the anchors of sticking points, nearest in the metric of M; one Newton
        step. A ball has no anchor.
        """
        anchor = ca.SX.sym("anchor", 2 * len(self.points))
        target = ca.vec(ca.vertcat(ca.SX(1, len(self.points)), ca.reshape(anchor, 2, -1)))
        s, rows, forces = self._s, self._mode.rows(), self._delassus.forces
        positional = self._positional_rows
        closed = ca.vertcat(
            s.q + self._B @ forces(self._geometry.place - target, ca.diag(positional), positional),
            s.v + self._B @ forces(self._A_moving @ s.v, ca.diag(rows), rows),
        )
        return dense_function("contact_close", [self._x, self._p, anchor], closed)

    @built_once
    def settle(self) -> ca.Function:
        """((q, v) stacked, p) -> velocities after an impulse along the contacts' forces.

        They are compatible with the closed contacts.
        """
        impulse = self._delassus.forces(self._speed, self._shares, self._mode.rows())
        return dense_function("contact_settle", [self._x, self._p], self._s.v + self._B @ impulse)

    @built_once
    def sites(self) -> ca.Function:
        """Normal, two tangents and contact point of each contact in the world frame, by q.

        In [m], shape (3, 4 nc).
        """
        sites = contact.sites(self._s.tree, self.points, self._s.q)
        return ca.Function("contact_sites", [self._s.q], [sites], {"cse": True})

    @built_once
    def friction_power(self) -> ca.Function:
        """(q, v, tau, p) -> power dissipated by friction of the contacts in [W]."""
        tangential = [i for i in range(self._force.shape[0]) if i % 3]
        power = -ca.dot(self._force[tangential], self._speed[tangential])
        return dense_function("friction_power", self._arguments, power)

    @one_at_a_time
    def slopes(self) -> ca.Function:
        """Derivatives of the torques of forces, and of the accelerations of the active rows.

        Returns:
            CasADi function (q, v, tau, p, q̈, force) -> both derivatives by q and v, forces and q̈
            being constant; these rows; accelerations of the joints per unknown force; and minus
            the unknown forces per acceleration of the rows.
        """
        A, S, shares, rows = self._geometry.rows, self._sliding, self._shares, self._mode.rows()
        a, force = ca.SX.sym("a", A.shape[1]), ca.SX.sym("f", A.shape[0])
        torque = S @ A.T @ (shares @ (rows * force))
        rates = rows * (self._A_moving @ a + ca.jtimes(self._speed, self._s.q, self._s.v))
        slopes = (ca.sparsify(ca.jacobian(of, self._x)) for of in (torque, rates))
        unknowns = -self._delassus.unknowns(shares, rows)
        solved = ca.diag(rows) @ self._A_moving, self._B @ shares, unknowns
        return ca.Function("slopes", [*self._arguments, a, force], [*slopes, *solved])

    @one_at_a_time
    def closing(self) -> ca.Function:
        """Derivatives of ``settle`` and ``close`` where the contacts are satisfied already.

        Returns:
            CasADi function ((q, v) stacked, p) -> derivatives of ``settle`` by q and v, and of
            ``close``, repeated, by q, v and anchors: velocities are projected at the closed
            positions.
        """
        A, B, q, n = self._geometry.rows, self._B, self._s.q, self._s.q.shape[0]
        shares, rows, unknowns = self._shares, self._mode.rows(), self._delassus.unknowns
        by_q, zeros, eye = ca.jacobian(self._geometry.place, q), ca.SX(n, n), ca.SX.eye(n)
        drift = ca.horzcat(ca.jacobian(self._speed, q), A)
        # At satisfied contacts the residuals vanish: the derivative of a projection is that of
        # x - (motion of the joints per residual) residual(x) with the first factor constant.
        # ``return_gain`` is the joint motion per change of a point's place, ``stop_gain`` that of
        # velocities, and ``stop_by_q`` the derivative by q of the velocity removed.
        return_gain = B @ unknowns(ca.diag(self._positional_rows), self._positional_rows)
        settled = B @ shares @ unknowns(shares, rows) @ -drift
        stop_gain = B @ unknowns(ca.diag(rows), rows)
        stop_by_q = stop_gain @ ca.jacobian(self._A_moving @ self._s.v, q)
        tangents = [i for i in range(A.shape[0]) if i % 3]
        positions = ca.horzcat(eye - return_gain @ by_q, zeros, return_gain[:, tangents])
        velocities = ca.horzcat(zeros, eye - stop_gain @ self._A_moving, ca.SX(n, len(tangents)))
        closed = ca.vertcat(positions, velocities - stop_by_q @ positions)
        results = ca.horzcat(zeros, eye) + settled, closed
        return dense_function("closing", [self._x, self._p], *results)

    @property
    def _positional_rows(self) -> ca.SX:
        """1 for active rows whose positions are restored."""
        return self._mode.rows() * contact.positional(self.points)
