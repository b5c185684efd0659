# SPDX-License-Identifier: Apache-2.0
"""Derivatives of inverse dynamics, with as many entries as joints act on one another.

Singh, Russell, Wensing, "Efficient analytical derivatives of rigid-body dynamics using spatial
vector algebra", IEEE Robotics and Automation Letters 7(2), 2022, for joints of one freedom. What
joint j changes in the motion of the bodies that it carries is, seen from them,

    by its position   v: Ṡ,  a: S̈ - v × Ṡ,  with Ṡ = v_λ × S, S̈ = a_λ × S + v_λ × Ṡ,
    by its speed      v: S,  a: 2 Ṡ - v × S,

so that the forces on composite bodies change by I S̈ + B Ṡ and 2 I Ṡ + B S, where
B x = x ×* (I v) + v ×* (I x) - I (v × x). All is written in the world's axes about its origin,
where composite bodies are plain sums.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from arm_dynamics.equations.rigid_body import placements
from arm_dynamics.equations.tree import Link, Tree, cross, moved, skew, spread_map

Spatial = tuple[ca.SX, ca.SX]
"""A motion (angular, linear), or a force (moment, force)."""


@dataclass
class _Joint:
    """Axis S of a joint with Ṡ and S̈, and the motion of its body."""

    S: Spatial
    rate: Spatial
    turn: Spatial
    v: Spatial
    a: Spatial


@dataclass
class _Composite:
    """Sums over a joint's body and all that hangs on it.

    Mass, first moment and inertia; matrix N and momentum P of B x = (N x_ang, 2 x_ang × P), to
    which B comes by Jacobi's identity; force that moves the bodies.
    """

    m: ca.SX
    h: ca.SX
    I: ca.SX  # noqa: E741 - the symbol of every book
    N: ca.SX
    P: ca.SX
    force: Spatial

    def inertia(self, x: Spatial) -> Spatial:
        return self.I @ x[0] + cross(self.h, x[1]), self.m * x[1] - cross(self.h, x[0])

    def bend(self, x: Spatial) -> Spatial:
        """B x."""
        return self.N @ x[0], 2 * cross(x[0], self.P)

    def add(self, other: _Composite) -> None:
        self.m, self.h, self.I = self.m + other.m, self.h + other.h, self.I + other.I
        self.N, self.P = self.N + other.N, self.P + other.P
        self.force = _plus(self.force, other.force)


def inverse_derivatives(
    tree: Tree, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Derivatives of ``rigid_body.inverse`` by q, v and a; the last is M.

    Args:
        tree: The robot.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        a: Joint accelerations, shape (n,).
        gravity: Gravity in the world frame in [m/s²], shape (3,).

    Returns:
        Three sparse matrices of shape (n, n): zero between joints on different branches.
    """
    E, count = spread_map(tree), len(tree.links)
    joints, bodies = _outward(tree, q, E @ v, E @ a, gravity)
    by_q, by_v, M = ca.SX(count, count), ca.SX(count, count), ca.SX(count, count)
    for i in reversed(range(count)):
        body, joint = bodies[i], joints[i]
        held = body.inertia(joint.S)
        bent = body.N.T @ joint.S[0] + 2 * cross(body.P, joint.S[1])
        change = _plus(body.inertia(joint.turn), body.bend(joint.rate))
        by_place = _plus(change, _force_cross(joint.S, body.force))
        by_speed = _plus(_twice(body.inertia(joint.rate)), body.bend(joint.S))
        j = i
        while j >= 0:
            other = joints[j]
            by_q[i, j] = _dot(held, other.turn) + ca.dot(bent, other.rate[0])
            by_v[i, j] = _dot(held, _twice(other.rate)) + ca.dot(bent, other.S[0])
            M[i, j] = _dot(held, other.S)
            if j != i:
                by_q[j, i], by_v[j, i] = _dot(other.S, by_place), _dot(other.S, by_speed)
                M[j, i] = M[i, j]
            j = tree.links[j].parent
        M[i, i] += float(tree.armature[i])
        if tree.links[i].parent >= 0:
            bodies[tree.links[i].parent].add(body)
    by_q, by_v, M = (ca.sparsify(E.T @ matrix @ E) for matrix in (by_q, by_v, M))
    return by_q, by_v, M


def _outward(
    tree: Tree, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
) -> tuple[list[_Joint], list[_Composite]]:
    """Joints, and bodies on their own."""
    still = ca.SX(3, 1), ca.SX(3, 1)
    ground = _Joint(still, still, still, v=still, a=(ca.SX(3, 1), -gravity))
    places: list[tuple[ca.SX, ca.SX]] = []
    joints: list[_Joint] = []
    bodies: list[_Composite] = []
    for i, (link, pose) in enumerate(zip(tree.links, placements(tree, q), strict=True)):
        R, p = places[link.parent] if link.parent >= 0 else (ca.SX.eye(3), ca.SX(3, 1))
        R, p = ca.sparsify(R @ pose.R), ca.sparsify(p + R @ pose.p)
        joint = _joint(link, R, p, joints[link.parent] if link.parent >= 0 else ground, v[i], a[i])
        places.append((R, p))
        joints.append(joint)
        bodies.append(_body(link, R, p, joint))
    return joints, bodies


def _joint(link: Link, R: ca.SX, p: ca.SX, parent: _Joint, v: ca.SX, a: ca.SX) -> _Joint:
    z = R[:, 2]
    S = (ca.SX(3, 1), z) if link.prismatic else (z, cross(p, z))
    rate = _motion_cross(parent.v, S)
    turn = _plus(_motion_cross(parent.a, S), _motion_cross(parent.v, rate))
    speed = _plus(parent.v, _times(v, S))
    return _Joint(S, rate, turn, speed, _plus(parent.a, _times(a, S), _times(v, rate)))


def _body(link: Link, R: ca.SX, p: ca.SX, joint: _Joint) -> _Composite:
    h, inertia = moved(R, p, link.m, link.h, link.I)
    (w, u), zero = joint.v, ca.SX(3, 1)
    body = _Composite(link.m, h, inertia, ca.SX(3, 3), zero, (zero, zero))
    L, body.P = body.inertia(joint.v)
    W = skew(w)
    turning = ca.trace(inertia) * W - 2 * (skew(inertia @ w) + inertia @ W)
    body.N = ca.sparsify(turning - 2 * (skew(cross(h, u)) + skew(u) @ skew(h)))
    body.force = _plus(body.inertia(joint.a), _force_cross(joint.v, (L, body.P)))
    return body


def _motion_cross(x: Spatial, y: Spatial) -> Spatial:
    return cross(x[0], y[0]), ca.sparsify(cross(x[0], y[1]) + cross(x[1], y[0]))


def _force_cross(x: Spatial, f: Spatial) -> Spatial:
    return ca.sparsify(cross(x[0], f[0]) + cross(x[1], f[1])), cross(x[0], f[1])


def _plus(*parts: Spatial) -> Spatial:
    angular, linear = zip(*parts, strict=True)
    return ca.sparsify(sum(angular[1:], angular[0])), ca.sparsify(sum(linear[1:], linear[0]))


def _times(factor: ca.SX, x: Spatial) -> Spatial:
    return factor * x[0], factor * x[1]


def _twice(x: Spatial) -> Spatial:
    return 2 * x[0], 2 * x[1]


def _dot(x: Spatial, y: Spatial) -> ca.SX:
    return ca.dot(x[0], y[0]) + ca.dot(x[1], y[1])
