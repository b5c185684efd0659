# SPDX-License-Identifier: Apache-2.0
"""How the joints respond to torques while some of them stick or are held by a stop.

A joint at rest under dry friction is not a stiff spring but a constraint, q̈ = 0, with the
friction as its reaction (Karnopp, "Computer simulation of stick-slip friction in mechanical
dynamic systems", J. Dyn. Sys. Meas. Control 107, 1985; Glocker, Set-Valued Force Laws, 2001).
A joint
at a rigid stop is held likewise, by a reaction that only pushes. Which joints are held is an
input, so that the expression has no branches.
"""

from __future__ import annotations

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.equations import contact, rigid_body
from arm_sim.plant.symbols import Joints, Symbols


class Response:
    """Accelerations of an arm with nothing but its joints to hold it.

    Args:
        model: The robot.
        s: Its symbols.
        joints: What the joints do.

    Attributes:
        load: Torques that act: those of the drives and compliant stops less gravity, inertial
            forces, springs and the friction of sliding joints, in [N m] or [N], shape (n,).
    """

    def __init__(self, model: ArmModel, s: Symbols, joints: Joints) -> None:
        n = model.n
        bias = rigid_body.inverse(s.tree, s.q, s.v, ca.SX(n, 1), s.gravity)
        self.load = s.tau - bias - s.passive - joints.friction + joints.stop
        self._M = rigid_body.mass_matrix(s.tree, s.q)
        self._sliding = ca.diag(joints.sliding)
        self._sticking = ca.SX.eye(n) - self._sliding
        self._held = self._sliding @ self._M @ self._sliding + self._sticking

    def accelerations(self, load: ca.SX) -> ca.SX:
        """Under torques ``load``, exactly zero where a joint sticks, shape (n,)."""
        return rigid_body.solve(self._held, self._sliding @ load)

    def mobility(self, forces: ca.SX) -> ca.SX:
        """Accelerations per unit of forces that act in columns of torques, shape (n, k)."""
        return contact.solve_columns(self._held, self._sliding @ forces)

    def reactions(self, load: ca.SX, a: ca.SX) -> ca.SX:
        """What holds sticking joints in [N m] or [N], zero where a joint slides, shape (n,).

        Args:
            load: Torques that act.
            a: ``accelerations`` under them.
        """
        return self._sticking @ (load - self._M @ a)

    def struck(self, push: ca.SX, change: ca.SX) -> tuple[ca.SX, ca.SX]:
        """A blow: velocities that jump, those of held joints by given amounts.

        Args:
            push: Impulses on the joints in [N m s] or [N s], shape (n,).
            change: What held joints gain in [rad/s] or [m/s], zero for the others, shape (n,).

        Returns:
            What all joints gain, and the impulses that hold the held ones, each of shape (n,).
        """
        free = self._sliding @ (push - self._M @ change)
        gain = change + rigid_body.solve(self._held, free)
        return gain, self._sticking @ (self._M @ gain - push)
