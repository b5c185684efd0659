# SPDX-License-Identifier: Apache-2.0
"""Analytical derivatives of inverse dynamics, as sparse as the coupling of the joints.

Singh, Russell, Wensing, "Efficient analytical derivatives of rigid-body dynamics using spatial
vector algebra", IEEE Robotics and Automation Letters 7(2), 2022, for joints of one freedom; about
the origins of the links, so that no linear velocity enters. A link's frame has the angular
velocity ω and the angular acceleration α, and its origin accelerates by c. Where these change by
δω, δα, δc, points that the link carries, at r with the velocity u relative to that origin,
accelerate more by δc + δβ × r + 2 δω × u, with δβ = δα + ω × δω (by Jacobi's identity). The force
and the moment on them so change by

    δf = m δc + δβ × h + δω × P,   δn = h × δc + I δβ + (1 tr Q - Q) δω,

where P = 2 Σ m u and Q = 2 Σ m u rᵀ add up over bodies as the mass m, the first moment h and the
inertia I do. A joint about z changes the motion of its link's frame

    by its position       δc = c × z,  δβ = α × z + ω × (ω × z),  δω = ω × z,
    by its speed          δβ = 2 ω × z,  δω = z,
    by its acceleration   δβ = z,

and its position turns the wrench (f, n) on the link, which the parent feels, by z × f, z × n.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from arm_dynamics.equations.rigid_body import motion, placements
from arm_dynamics.equations.tree import Link, Tree, cross, moved, skew, spread_map

# Above this many joints pairs of them are compared in the world's axes: that takes dot products
# of full vectors, but none is taken down link by link.
IN_LINKS_AT_MOST = 16


@dataclass
class _Change:
    """Change (δc, δβ, δω) of the motion of a frame, or a row that is multiplied by one."""

    c: ca.SX
    beta: ca.SX
    omega: ca.SX

    def dot(self, other: _Change) -> ca.SX:
        angular = ca.dot(self.beta, other.beta) + ca.dot(self.omega, other.omega)
        return ca.dot(self.c, other.c) + angular


@dataclass
class _Wrench:
    """Force and moment about the origin of a frame."""

    f: ca.SX
    n: ca.SX

    def dot(self, change: _Change) -> ca.SX:
        """Force along a joint's axis; ``change`` is that by its acceleration."""
        return ca.dot(self.f, change.c) + ca.dot(self.n, change.beta)


type _Terms = tuple[_Change, _Wrench, _Wrench]  # see ``_joint_terms``


@dataclass
class _Frame:
    """Placement of a frame in another one.

    Attributes:
        R: Rotation.
        p: Origin.
        d: Twice the velocity of the origin relative to that of the other frame.
    """

    R: ca.SX
    p: ca.SX
    d: ca.SX

    def of(self, inner: _Frame) -> _Frame:
        """The placement of a frame that is placed in this one."""
        p, d = self.p + self.R @ inner.p, self.d + self.R @ inner.d
        return _Frame(ca.sparsify(self.R @ inner.R), ca.sparsify(p), ca.sparsify(d))

    def wrench(self, x: _Wrench) -> _Wrench:
        f = ca.sparsify(self.R @ x.f)
        return _Wrench(f, ca.sparsify(self.R @ x.n + cross(self.p, f)))

    def row(self, x: _Change) -> _Change:
        c = ca.sparsify(self.R @ x.c)
        beta, omega = self.R @ x.beta + cross(self.p, c), self.R @ x.omega + cross(self.d, c)
        return _Change(c, ca.sparsify(beta), ca.sparsify(omega))

    def change(self, x: _Change) -> _Change:
        beta, omega = ca.sparsify(self.R @ x.beta), ca.sparsify(self.R @ x.omega)
        c = self.R @ x.c - cross(beta, self.p) - cross(omega, self.d)
        return _Change(ca.sparsify(c), beta, omega)

    def terms(self, row: _Change, by_position: _Wrench, by_speed: _Wrench) -> _Terms:
        """Those of ``_joint_terms``, from this frame to the other one."""
        return self.row(row), self.wrench(by_position), self.wrench(by_speed)


@dataclass
class _Joint:
    """Changes of a link's motion by the position, speed and acceleration of its joint."""

    by_position: _Change
    by_speed: _Change
    by_acceleration: _Change

    def placed_in(self, frame: _Frame) -> _Joint:
        return _Joint(*map(frame.change, (self.by_position, self.by_speed, self.by_acceleration)))


@dataclass
class _Composite:
    """Sums over a link's body and all that hangs on it, about the origin of the link's frame."""

    m: ca.SX
    h: ca.SX
    I: ca.SX  # noqa: E741 - the symbol of every book
    P: ca.SX
    Q: ca.SX
    wrench: _Wrench

    @property
    def N(self) -> ca.SX:
        """1 tr Q - Q."""
        return ca.sparsify(ca.trace(self.Q) * ca.SX.eye(3) - self.Q)

    def response(self, x: _Change) -> _Wrench:
        """Change of the wrench."""
        f = self.m * x.c + cross(x.beta, self.h) + cross(x.omega, self.P)
        n = cross(self.h, x.c) + self.I @ x.beta + self.N @ x.omega
        return _Wrench(ca.sparsify(f), ca.sparsify(n))

    def row(self, axis: _Change) -> _Change:
        """The row that gives, of a change of motion, the change of the force along an axis."""
        c = self.m * axis.c + cross(axis.beta, self.h)
        beta = cross(self.h, axis.c) + self.I @ axis.beta
        omega = cross(self.P, axis.c) + self.N.T @ axis.beta
        return _Change(ca.sparsify(c), ca.sparsify(beta), ca.sparsify(omega))

    def add(self, other: _Composite, frame: _Frame) -> None:
        """Add what hangs on a link that is placed in this one."""
        h, inertia = moved(frame.R, frame.p, other.m, other.h, other.I)
        P, wrench = ca.sparsify(frame.R @ other.P), frame.wrench(other.wrench)
        Q = frame.R @ other.Q @ frame.R.T + P @ frame.p.T + frame.d @ h.T
        self.m, self.h, self.I = self.m + other.m, self.h + h, self.I + inertia
        self.P, self.Q = self.P + P + other.m * frame.d, self.Q + Q
        self.wrench = _Wrench(self.wrench.f + wrench.f, self.wrench.n + wrench.n)


def inverse_derivatives(
    tree: Tree, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Derivatives of ``rigid_body.inverse_dynamics`` by q, v and a; the last is M.

    Args:
        tree: The robot.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        a: Joint accelerations, shape (n,).
        gravity: Gravity in the world frame in [m/s²], shape (3,).

    Returns:
        Three sparse matrices of shape (n, n): zero between joints on different branches.
    """
    E, links = spread_map(tree), tree.links
    frames, joints, bodies = _outward(tree, q, E @ v, E @ a, gravity)
    in_links = len(links) <= IN_LINKS_AT_MOST
    worlds, changes = (frames, joints) if in_links else _in_world(tree, frames, joints)
    by_q, by_v, M = (ca.SX(len(links), len(links)) for _ in range(3))
    for i in reversed(range(len(links))):
        row, by_position, by_speed = _joint_terms(bodies[i], joints[i], links[i])
        if not in_links:
            row, by_position, by_speed = worlds[i].terms(row, by_position, by_speed)
        j = i
        while j >= 0:
            by_q[i, j], by_v[i, j] = row.dot(changes[j].by_position), row.dot(changes[j].by_speed)
            axis = changes[j].by_acceleration
            M[i, j] = M[j, i] = row.dot(axis)
            if j != i:
                by_q[j, i], by_v[j, i] = by_position.dot(axis), by_speed.dot(axis)
            if in_links:
                row, by_position, by_speed = frames[j].terms(row, by_position, by_speed)
            j = links[j].parent
        M[i, i] += float(tree.armature[i])
        if links[i].parent >= 0:
            bodies[links[i].parent].add(bodies[i], frames[i])
    by_q, by_v, M = (ca.sparsify(E.T @ matrix @ E) for matrix in (by_q, by_v, M))
    return by_q, by_v, M


def _outward(
    tree: Tree, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX
) -> tuple[list[_Frame], list[_Joint], list[_Composite]]:
    """Frames in those of the parents, joints, and bodies on their own."""
    pose = placements(tree, q)
    motions = list(zip(*motion(tree, pose, v, a, gravity), strict=True))
    frames, joints, bodies = list[_Frame](), list[_Joint](), list[_Composite]()
    for i, link in enumerate(tree.links):
        R, p = pose[i].R, pose[i].p
        omega = motions[link.parent][0] if link.parent >= 0 else ca.SX(3, 1)
        slides = v[i] * R[:, 2] if link.prismatic else ca.SX(3, 1)
        frames.append(_Frame(R, p, ca.sparsify(cross(omega, 2 * p) + 2 * slides)))
        joints.append(_joint(link, *motions[i]))
        bodies.append(_body(link, *motions[i]))
    return frames, joints, bodies


def _in_world(
    tree: Tree, frames: list[_Frame], joints: list[_Joint]
) -> tuple[list[_Frame], list[_Joint]]:
    """Frames and joints in the world's axes, about its origin."""
    worlds = list[_Frame]()
    for link, frame in zip(tree.links, frames, strict=True):
        worlds.append(worlds[link.parent].of(frame) if link.parent >= 0 else frame)
    return worlds, [joint.placed_in(world) for joint, world in zip(joints, worlds, strict=True)]


def _joint(link: Link, omega: ca.SX, alpha: ca.SX, c: ca.SX) -> _Joint:
    z, none = ca.sparsify(ca.SX([0, 0, 1])), ca.SX(3, 1)
    turn = cross(omega, z)
    bend = ca.sparsify(cross(alpha, z) + cross(omega, turn))
    if link.prismatic:
        return _Joint(*(_Change(c, none, none) for c in (bend, 2 * turn, z)))
    by_position, by_speed = _Change(cross(c, z), bend, turn), _Change(none, 2 * turn, z)
    return _Joint(by_position, by_speed, _Change(none, z, none))


def _body(link: Link, omega: ca.SX, alpha: ca.SX, c: ca.SX) -> _Composite:
    W = skew(omega)
    second = ca.sparsify(ca.trace(link.I) * ca.SX.eye(3) - 2 * link.I)  # 2 Σ m r rᵀ
    f = link.m * c + (skew(alpha) + W @ W) @ link.h
    n = link.I @ alpha + cross(omega, link.I @ omega) + cross(link.h, c)
    P, Q = cross(omega, 2 * link.h), ca.sparsify(W @ second)
    return _Composite(link.m, link.h, link.I, P, Q, _Wrench(ca.sparsify(f), ca.sparsify(n)))


def _joint_terms(body: _Composite, joint: _Joint, link: Link) -> _Terms:
    """The row of a joint's torque, and the changes of its wrench by its position and speed."""
    change, z = body.response(joint.by_position), ca.sparsify(ca.SX([0, 0, 1]))
    turned = cross(z, body.wrench.f)
    if link.prismatic:
        change.n = ca.sparsify(change.n + turned)
    else:
        change.f, change.n = change.f + turned, ca.sparsify(change.n + cross(z, body.wrench.n))
    return body.row(joint.by_acceleration), change, body.response(joint.by_speed)
