# SPDX-License-Identifier: Apache-2.0
"""Response of the joints to torques while some of them stick or are held by a stop.

A joint at rest under dry friction is modelled by a constraint, q̈ = 0, with the friction as its
reaction (Karnopp, "Computer simulation of stick-slip friction in mechanical dynamic systems", J.
Dyn. Sys. Meas. Control 107, 1985; Glocker, Set-Valued Force Laws, 2001). A joint at a rigid stop
is held likewise, by a reaction that only pushes. The set of held joints is an input, so the
expression has no branches.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from arm_dynamics import ArmModel
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.factorizations import ltdl
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST, hybrid
from arm_sim.plant.symbols import Joints, Symbols


class Response:
    """Accelerations of an arm that is held by its joints alone.

    Args:
        model: The robot.
        s: Its symbols.
        joints: Modes of the joints.

    Attributes:
        load: Acting torques: those of the drives and compliant stops less gravity, inertial
            forces, springs and the friction of sliding joints, in [N m] or [N], shape (n,).
        algorithm: Name of the algorithm, for display.
    """

    algorithm = "composite bodies and LDLᵀ"

    def __init__(self, model: ArmModel, s: Symbols, joints: Joints) -> None:
        n = model.n
        bias = rigid_body.inverse_dynamics(s.tree, s.q, s.v, ca.SX(n, 1), s.gravity)
        self.load = s.tau - bias - s.passive - joints.friction + joints.stop
        self._M = rigid_body.mass_matrix(s.tree, s.q)
        self._sliding = ca.diag(joints.sliding)
        self._sticking = ca.SX.eye(n) - self._sliding
        self._held = self._sliding @ self._M @ self._sliding + self._sticking

    def accelerations(self, load: ca.SX) -> ca.SX:
        """Under torques ``load``, exactly zero where a joint sticks, shape (n,)."""
        return ltdl.solve(self._held, self._sliding @ load)

    def mobility(self, forces: ca.SX) -> ca.SX:
        """Accelerations per unit of forces that act in columns of torques, shape (n, k)."""
        return ltdl.solve_columns(self._held, self._sliding @ forces)

    def reactions(self, load: ca.SX, a: ca.SX) -> ca.SX:
        """Holding torques of sticking joints in [N m] or [N], zero for sliding ones, shape (n,).

        Args:
            load: Acting torques.
            a: ``accelerations`` under these torques.
        """
        return self._sticking @ (load - self._M @ a)

    def impact(self, push: ca.SX, change: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Jumps of the velocities in an impact, prescribed for held joints.

        Args:
            push: Impulses on the joints in [N m s] or [N s], shape (n,).
            change: Velocity changes of held joints in [rad/s] or [m/s], zero for the others, shape
                (n,).

        Returns:
            Velocity changes of all joints, and the impulses on the held ones, each of shape (n,).
        """
        free = self._sliding @ (push - self._M @ change)
        gain = change + ltdl.solve(self._held, free)
        return gain, self._sticking @ (self._M @ gain - push)


class RecursiveResponse:
    """``Response`` in linear time in the number of joints, for arms without mimic joints.

    Args:
        model: The robot.
        s: Its symbols.
        joints: Modes of the joints.

    Attributes:
        load: Acting torques as of ``Response``, without gravity and inertial forces, shape (n,).
        algorithm: Name of the algorithm, for display.
    """

    algorithm = "articulated bodies"

    def __init__(self, model: ArmModel, s: Symbols, joints: Joints) -> None:
        self._zero, self._s, self._sliding = ca.SX(model.n, 1), s, joints.sliding
        self.load = s.tau - s.passive - joints.friction + joints.stop

    def accelerations(self, load: ca.SX) -> ca.SX:
        """Accelerations as of ``Response``."""
        return self._motion(load)[0]

    def reactions(self, load: ca.SX, a: ca.SX) -> ca.SX:
        """Reactions as of ``Response``; ``a`` follows from the load."""
        return self._motion(load)[1]

    def impact(self, push: ca.SX, change: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Impact as of ``Response``: impulses change velocities as torques cause accelerations."""
        s, zero = self._s, self._zero
        gain, reaction = hybrid(s.tree, s.q, zero, push, ca.SX(3, 1), self._sliding, change)
        return gain, -reaction

    def _motion(self, load: ca.SX) -> tuple[ca.SX, ca.SX]:
        s = self._s
        return hybrid(s.tree, s.q, s.v, load, s.gravity, self._sliding, self._zero)


type AnyResponse = Response | RecursiveResponse


def response_of(model: ArmModel, s: Symbols, joints: Joints) -> AnyResponse:
    """The faster response for an arm that is held by its joints alone."""
    if model.n > DENSE_AT_MOST and not s.tree.has_followers:
        return RecursiveResponse(model, s, joints)
    return Response(model, s, joints)


@dataclass(frozen=True)
class Reactions:
    """Forces of held joints and contacts: expressions.

    Attributes:
        a: Accelerations of the joints, shape (n,).
        loads: Holding torques of sticking joints relative to what friction bears, forces and
            accelerations of the contact points, and acceleration of each gap per normal force
            where it closes (grip).
        held: Holding torques of held joints, shape (n,).
        push: Joint torques of the contacts, shape (n,).
        spread: Joint torques per unknown contact force, shape (n, 3 nc); zero in modes without
            that force.
        jacobian: Velocities of the contact points per velocity of the joints, shape (3 nc, n).
    """

    a: ca.SX
    loads: Sequence[ca.SX]
    held: ca.SX
    push: ca.SX
    spread: ca.SX
    jacobian: ca.SX


def joint_reactions(s: Symbols, response: AnyResponse) -> Reactions:
    """Reactions of held joints, without contacts."""
    a, none = response.accelerations(response.load), ca.SX(0, 1)
    held, n = response.reactions(response.load, a), s.q.shape[0]
    relative = s.friction.relative_hold(held, s.q, s.tau)
    return Reactions(a, (relative, none, none, none), held, ca.SX(n, 1), ca.SX(n, 0), ca.SX(0, n))
