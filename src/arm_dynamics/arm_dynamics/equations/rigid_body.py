# SPDX-License-Identifier: Apache-2.0
"""Rigid-body dynamics of a tree: inverse dynamics, M, C, gravity, energy and forward dynamics.

Recursive Newton-Euler with the angular tensor of Khalil and Dombre (Modeling, Identification and
Control of Robots, 2002, chapter 9) and composite rigid bodies (Featherstone, Rigid Body Dynamics
Algorithms, 2008, chapters 5 and 6). ``forward_dynamics`` has the articulated-body algorithm, which
is faster for long chains.
"""

import casadi as ca

from arm_dynamics.equations.factorizations import ltdl
from arm_dynamics.equations.tree import Link, Tree, constant, cross, moved, skew, spread_map


class Placement:
    """Placement of a link in its parent's frame at joint position ``q``.

    Attributes:
        R: Rotation from link to parent axes, shape (3, 3).
        p: Origin of the link frame in the parent's in [m], shape (3,).
    """

    def __init__(self, link: Link, q: ca.SX) -> None:
        R, p = constant(link.R), constant(link.p)
        if link.prismatic:
            self.R, self.p = R, ca.sparsify(p + R[:, 2] * q)
            return
        c, s = ca.cos(q), ca.sin(q)
        turn = ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
        self.R, self.p = R @ ca.sparsify(turn), p


def placements(tree: Tree, q: ca.SX) -> list[Placement]:
    """Placements of all links for independent joint positions ``q`` of shape (n,)."""
    full = spread_map(tree) @ q + constant(tree.offsets)
    return [Placement(link, full[i]) for i, link in enumerate(tree.links)]


def motion(
    tree: Tree, pose: list[Placement], v: ca.SX, a: ca.SX, gravity: ca.SX
) -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
    """Angular velocity, angular and linear acceleration of every link frame, in link axes.

    Args:
        tree: The robot.
        pose: Placements of all links.
        v: Velocities of all links' joints in [rad/s] or [m/s].
        a: Accelerations of all links' joints in [rad/s²] or [m/s²].
        gravity: Gravity in the world frame in [m/s²], shape (3,), counted as an acceleration of
            the ground upwards.
    """
    omega, alpha, acc = list[ca.SX](), list[ca.SX](), list[ca.SX]()
    z = ca.sparsify(ca.SX([0, 0, 1]))
    for i, link in enumerate(tree.links):
        R, p = pose[i].R, pose[i].p
        if link.parent < 0:
            w, dw, dv = ca.SX(3, 1), ca.SX(3, 1), R.T @ -gravity
        else:
            j = link.parent
            w, dw = R.T @ omega[j], R.T @ alpha[j]
            dv = R.T @ (acc[j] + _angular_tensor(omega[j], alpha[j]) @ p)
        if link.prismatic:
            dv = dv + 2 * v[i] * cross(w, z) + a[i] * z
        else:
            dw = dw + v[i] * cross(w, z) + a[i] * z
            w = w + v[i] * z
        omega.append(ca.sparsify(w))
        alpha.append(ca.sparsify(dw))
        acc.append(ca.sparsify(dv))
    return omega, alpha, acc


def inverse_dynamics(tree: Tree, q: ca.SX, v: ca.SX, a: ca.SX, gravity: ca.SX) -> ca.SX:
    """Torques M a + C v + G of a tree, by recursive Newton-Euler.

    Args:
        tree: The robot.
        q: Joint positions in [rad] or [m], shape (n,).
        v: Joint velocities, shape (n,).
        a: Joint accelerations, shape (n,).
        gravity: Gravity in the world frame in [m/s²], shape (3,).

    Returns:
        Joint torques in [N m] or [N], shape (n,).
    """
    pose = placements(tree, q)
    v_full, a_full = spread_map(tree) @ v, spread_map(tree) @ a
    omega, alpha, acc = motion(tree, pose, v_full, a_full, gravity)
    tau = ca.SX(len(tree.links), 1)
    force = [ca.SX(3, 1) for _ in tree.links]
    moment = [ca.SX(3, 1) for _ in tree.links]
    for i in reversed(range(len(tree.links))):
        link = tree.links[i]
        f = force[i] + link.m * acc[i] + _angular_tensor(omega[i], alpha[i]) @ link.h
        gyroscopic = cross(omega[i], link.I @ omega[i])
        n = moment[i] + link.I @ alpha[i] + gyroscopic + cross(link.h, acc[i])
        tau[i] = (f if link.prismatic else n)[2] + float(tree.armature[i]) * a_full[i]
        if link.parent >= 0:
            f = pose[i].R @ f
            force[link.parent] += f
            moment[link.parent] += pose[i].R @ n + cross(pose[i].p, f)
    return spread_map(tree).T @ tau


def mass_matrix(tree: Tree, q: ca.SX) -> ca.SX:
    """Joint-space inertia M(q) in [kg m²] or [kg], shape (n, n), armature included.

    By the composite-rigid-body algorithm; source: see the module.
    """
    pose = placements(tree, q)
    count = len(tree.links)
    mass = [link.m for link in tree.links]
    h = [link.h for link in tree.links]
    inertia = [link.I for link in tree.links]
    M = ca.SX(count, count)
    for i in reversed(range(count)):
        link = tree.links[i]
        if link.parent >= 0:
            h_moved, inertia_moved = moved(pose[i].R, pose[i].p, mass[i], h[i], inertia[i])
            mass[link.parent] = mass[link.parent] + mass[i]
            h[link.parent] = h[link.parent] + h_moved
            inertia[link.parent] = inertia[link.parent] + inertia_moved
        if link.prismatic:
            f, n = ca.vertcat(0, 0, mass[i]), ca.vertcat(h[i][1], -h[i][0], 0)
        else:
            f, n = ca.vertcat(-h[i][1], h[i][0], 0), inertia[i][:, 2]
        M[i, i] = (f if link.prismatic else n)[2] + float(tree.armature[i])
        _project(tree, pose, M, i, ca.sparsify(f), ca.sparsify(n))
    return spread_map(tree).T @ M @ spread_map(tree)


def coriolis_matrix(tree: Tree, q: ca.SX, v: ca.SX) -> ca.SX:
    """Coriolis matrix C(q, v) of Christoffel symbols; dM/dt - 2 C is skew-symmetric; shape (n, n).

    Their sum over the velocities is C = (Ṁ + P - Pᵀ) / 2 with P = ∂(M v)/∂q (Siciliano and others,
    Robotics: Modelling, Planning and Control, 2009, section 7.2.1).
    """
    M = mass_matrix(tree, q)
    P = ca.jacobian(M @ v, q)
    return ca.sparsify((ca.jtimes(M, q, v) + P - P.T) / 2)


def potential_energy(tree: Tree, q: ca.SX, gravity: ca.SX) -> ca.SX:
    """Gravitational energy in [J], zero with every centre of mass at the world's origin.

    Args:
        tree: The robot, its inertia not regrouped.
        q: Joint positions in [rad] or [m], shape (n,).
        gravity: Gravity in the world frame in [m/s²], shape (3,).
    """
    pose = placements(tree, q)
    mass = [link.m for link in tree.links]
    h = [link.h for link in tree.links]
    grounded = ca.SX(3, 1)
    for i in reversed(range(len(tree.links))):
        carried, parent = pose[i].R @ h[i] + mass[i] * pose[i].p, tree.links[i].parent
        if parent >= 0:
            mass[parent], h[parent] = mass[parent] + mass[i], h[parent] + carried
        else:
            grounded += carried
    return -ca.dot(gravity, grounded)


def forward_dense(tree: Tree, q: ca.SX, v: ca.SX, tau: ca.SX, gravity: ca.SX) -> ca.SX:
    """Accelerations M⁻¹ (tau - C v - G), shape (n,).

    M is computed by the composite-rigid-body algorithm and factored as LᵀDL.
    """
    bias = inverse_dynamics(tree, q, v, ca.SX(v.shape[0], 1), gravity)
    return ltdl.solve(mass_matrix(tree, q), tau - bias)


def gravity_torque(tree: Tree, q: ca.SX, gravity: ca.SX) -> ca.SX:
    """Gravity torques G(q) in [N m] or [N] that balance the arm's weight, shape (n,)."""
    still = ca.SX(q.shape[0], 1)
    return inverse_dynamics(tree, q, still, still, gravity)


def _angular_tensor(omega: ca.SX, alpha: ca.SX) -> ca.SX:
    """[alpha]x + [omega]x²: maps a point of a link to its acceleration relative to the origin."""
    return skew(alpha) + skew(omega) @ skew(omega)


def _project(tree: Tree, pose: list[Placement], M: ca.SX, i: int, f: ca.SX, n: ca.SX) -> None:
    """Fill row and column ``i`` of M.

    The wrench that accelerates the subtree of joint ``i`` is propagated to the ground.
    """
    j = i
    while tree.links[j].parent >= 0:
        f = pose[j].R @ f
        n = pose[j].R @ n + cross(pose[j].p, f)
        j = tree.links[j].parent
        M[i, j] = M[j, i] = (f if tree.links[j].prismatic else n)[2]
