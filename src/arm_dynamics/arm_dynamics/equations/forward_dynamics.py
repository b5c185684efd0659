# SPDX-License-Identifier: Apache-2.0
"""Forward dynamics by the algorithms that may be the fastest for a tree.

The articulated-body algorithm takes work proportional to the number of joints: Featherstone, Rigid
Body Dynamics Algorithms, 2008, section 7.3, in link axes, with the 6 by 6 articulated inertia
stored as the three 3 by 3 blocks of [[A, H], [Hᵀ, I]]: force from acceleration, force from
rotation, moment from rotation.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.rigid_body import Placement, placements
from arm_dynamics.equations.tree import Link, Tree, cross, skew, symmetric

# Linear and angular velocity or acceleration of a link's frame, in its axes
type Twist = tuple[ca.SX, ca.SX]


@dataclass
class _Body:
    """Articulated inertia (A, H, I) and bias wrench (f, n) of a link and its subtree."""

    A: ca.SX
    H: ca.SX
    I: ca.SX  # noqa: E741 - the symbol of every book
    f: ca.SX
    n: ca.SX


@dataclass(frozen=True)
class _Joint:
    """Results of the inward pass for the outward one.

    Column U of the articulated inertia, pivot D, free torque u and bias acceleration c, which
    includes a prescribed acceleration; and whether the joint is free.
    """

    U_f: ca.SX
    U_n: ca.SX
    D: ca.SX
    u: ca.SX
    c_f: ca.SX
    c_n: ca.SX
    free: ca.SX


def articulated_bodies(tree: Tree, q: ca.SX, v: ca.SX, tau: ca.SX, gravity: ca.SX) -> ca.SX:
    """Accelerations that torques produce, by the articulated-body algorithm.

    Args:
        tree: The robot, without mimic joints.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        tau: Joint torques in [N m] or [N], shape (n,).
        gravity: Gravity in the world frame in [m/s²], shape (3,).

    Returns:
        Joint accelerations, shape (n,).
    """
    n = len(tree.links)
    return hybrid(tree, q, v, tau, gravity, ca.SX.ones(n), ca.SX(n, 1))[0]


def hybrid(
    tree: Tree, q: ca.SX, v: ca.SX, tau: ca.SX, gravity: ca.SX, free: ca.SX, prescribed: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Articulated-body algorithm with prescribed accelerations of some joints.

    Such a joint passes all of its body's inertia to the parent, as if it were fixed (Featherstone,
    Rigid Body Dynamics Algorithms, 2008, section 9.2).

    Args:
        tree: The robot, without mimic joints.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        tau: Joint torques in [N m] or [N], shape (n,).
        gravity: Gravity in the world frame in [m/s²], shape (3,).
        free: 1 for a joint that torques accelerate, 0 for one with prescribed acceleration.
        prescribed: Prescribed accelerations, zero for free joints, shape (n,).

    Returns:
        Joint accelerations, and the torques to subtract from ``tau`` where they are prescribed,
        zero for free joints, each of shape (n,).
    """
    pose = placements(tree, q)
    velocity = _velocities(tree, pose, v)
    bodies = [_free_body(link, *velocity[i]) for i, link in enumerate(tree.links)]
    joints: dict[int, _Joint] = {}
    for i in reversed(range(len(tree.links))):
        link = tree.links[i]
        joints[i] = _joint(tree, i, bodies[i], velocity[i], v[i], prescribed[i], tau[i], free[i])
        if link.parent >= 0:
            _add_to_parent(bodies[link.parent], bodies[i], joints[i], pose[i])
    a, deficit = _accelerations(tree, pose, joints, gravity)
    return a + prescribed, (1 - free) * deficit


def _velocities(tree: Tree, pose: list[Placement], v: ca.SX) -> list[Twist]:
    """Linear and angular velocity of every link frame, in link axes."""
    z = ca.sparsify(ca.SX([0, 0, 1]))
    velocities = list[Twist]()
    for i, link in enumerate(tree.links):
        R, p = pose[i].R, pose[i].p
        lin, ang = velocities[link.parent] if link.parent >= 0 else (ca.SX(3, 1), ca.SX(3, 1))
        lin, ang = R.T @ (lin + cross(ang, p)), R.T @ ang
        lin, ang = (lin + v[i] * z, ang) if link.prismatic else (lin, ang + v[i] * z)
        velocities.append((ca.sparsify(lin), ca.sparsify(ang)))
    return velocities


def _free_body(link: Link, lin: ca.SX, ang: ca.SX) -> _Body:
    """Inertia and velocity-product wrench of a single link."""
    p_lin = link.m * lin + cross(ang, link.h)
    p_ang = cross(link.h, lin) + link.I @ ang
    return _Body(
        A=ca.sparsify(link.m * ca.SX.eye(3)),
        H=ca.sparsify(-skew(link.h)),
        I=link.I,
        f=cross(ang, p_lin),
        n=ca.sparsify(cross(ang, p_ang) + cross(lin, p_lin)),
    )


def _joint(
    tree: Tree, i: int, body: _Body, velocity: Twist, v: ca.SX, a: ca.SX, tau: ca.SX, free: ca.SX
) -> _Joint:
    """The joint of a link; ``a`` is its prescribed acceleration, zero if it is free."""
    z = ca.sparsify(ca.SX([0, 0, 1]))
    lin, ang = velocity
    if tree.links[i].prismatic:
        U_f, U_n = body.A[:, 2], body.H[2, :].T
        D, u = U_f[2], tau - body.f[2]
        c_f, c_n = v * cross(ang, z) + a * z, ca.SX(3, 1)
    else:
        U_f, U_n = body.H[:, 2], body.I[:, 2]
        D, u = U_n[2], tau - body.n[2]
        c_f, c_n = v * cross(lin, z), v * cross(ang, z) + a * z
    armature = float(tree.armature[i])
    u = u - armature * a
    return _Joint(U_f, U_n, D + armature, u, ca.sparsify(c_f), ca.sparsify(c_n), free)


def _add_to_parent(parent: _Body, body: _Body, joint: _Joint, pose: Placement) -> None:
    """Add to the parent the articulated inertia and bias of the body behind the joint."""
    s_f, s_n = joint.free * (joint.U_f / joint.D), joint.free * (joint.U_n / joint.D)
    A = symmetric(body.A - s_f @ joint.U_f.T)
    H = ca.sparsify(body.H - s_f @ joint.U_n.T)
    inertia = symmetric(body.I - s_n @ joint.U_n.T)
    f = body.f + A @ joint.c_f + H @ joint.c_n + s_f * joint.u
    n = body.n + H.T @ joint.c_f + inertia @ joint.c_n + s_n * joint.u
    R, P = pose.R, skew(pose.p)
    A, H = symmetric(R @ A @ R.T), R @ H @ R.T
    PH = P @ H
    parent.A = parent.A + A
    parent.H = parent.H + H - A @ P
    parent.I = parent.I + symmetric(R @ inertia @ R.T + PH + PH.T - P @ A @ P)
    f = R @ f
    parent.f = parent.f + f
    parent.n = parent.n + R @ n + cross(pose.p, f)


def _accelerations(
    tree: Tree, pose: list[Placement], joints: dict[int, _Joint], gravity: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Accelerations of free joints, and the excess or deficit of each joint's torque."""
    z = ca.sparsify(ca.SX([0, 0, 1]))
    a, deficit = ca.SX(len(tree.links), 1), ca.SX(len(tree.links), 1)
    spatial = list[Twist]()
    for i, link in enumerate(tree.links):
        R, p, joint = pose[i].R, pose[i].p, joints[i]
        lin, ang = spatial[link.parent] if link.parent >= 0 else (-gravity, ca.SX(3, 1))
        lin = R.T @ (lin + cross(ang, p)) + joint.c_f
        ang = R.T @ ang + joint.c_n
        deficit[i] = joint.u - joint.U_f.T @ lin - joint.U_n.T @ ang
        a[i] = joint.free * (deficit[i] / joint.D)
        lin, ang = (lin + a[i] * z, ang) if link.prismatic else (lin, ang + a[i] * z)
        spatial.append((lin, ang))
    return a, deficit


Law = Callable[[Tree, ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]

# Above this many joints, the mass matrix, of order n³ to factor, is never faster.
DENSE_AT_MOST = 16


def algorithms(tree: Tree, n: int) -> list[tuple[str, Law]]:
    """Names, for display, and functions (tree, q, v, tau, gravity) -> accelerations.

    Args:
        tree: The robot.
        n: Its degrees of freedom.
    """
    dense = ("composite bodies and LDLᵀ", rigid_body.forward_dense)
    recursive = ("articulated bodies", articulated_bodies)
    if tree.has_followers:
        return [dense]
    return [recursive] if n > DENSE_AT_MOST else [dense, recursive]
