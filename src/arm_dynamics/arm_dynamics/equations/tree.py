# SPDX-License-Identifier: Apache-2.0
"""A robot's links in the form in which its equations of motion are shortest.

Two exact changes of description, made before any equation is written:

* every joint frame is turned so that its axis is z;
* inertia that a joint cannot tell from its parent's is moved to the parent (base inertial
  parameters: Gautier and Khalil, "Direct calculation of minimum set of inertial parameters of
  serial robots", IEEE Trans. Robotics and Automation 6(3), 1990). A body that is symmetric about a
  revolute axis and has no inertia about it feels the same whether the joint turns or not; so does
  the rotational inertia of a body on a prismatic joint. A link's own numbers may thus be
  unphysical, but not one torque or acceleration changes, and many products vanish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from arm_dynamics.model.arm import ArmModel

Array = NDArray[np.float64]

# Products of rotations by multiples of 90 degrees leave dirt of a few units of rounding: factors
# that would not fold away.
DIRT = 1e-15


@dataclass
class Link:
    """One moving link; all quantities in its own joint frame, whose z is the joint's axis.

    Attributes:
        parent: Index of the parent link, -1 for the ground.
        prismatic: Whether the joint slides along z instead of turning about it.
        R: Rotation of the joint frame in the parent's at q = 0, shape (3, 3).
        p: Origin of the joint frame in the parent's in [m], shape (3,).
        m: Mass in [kg].
        h: First moment of mass in [kg m], shape (3,).
        I: Inertia about the frame's origin in [kg m²], shape (3, 3).
    """

    parent: int
    prismatic: bool
    R: Array
    p: Array
    m: ca.SX
    h: ca.SX
    I: ca.SX  # noqa: E741 - the symbol of every book


@dataclass(frozen=True)
class Tree:
    """Links in an order in which parents come first, with what is constant about their joints.

    Attributes:
        links: One for each of Pinocchio's joints.
        armature: Drive inertia of each joint in [kg m²] or [kg].
        followers: Map E from independent velocities to those of the links.
        offsets: Offset e of the link positions.
    """

    links: tuple[Link, ...]
    armature: Array
    followers: Array
    offsets: Array

    @property
    def has_followers(self) -> bool:
        """Whether a link's position is another one's times a factor."""
        return bool(self.followers.shape[0] != self.followers.shape[1])


def tree_of(
    model: ArmModel, payloads: Sequence[ca.SX] | None = None, regroup: bool = True
) -> Tree:
    """Describe a robot for the laws.

    Args:
        model: The robot.
        payloads: In place of the scene's payloads, mass, centre of mass (3) and inertia (6) of
            each as symbols.
        regroup: Whether to move inertia to parents where that changes nothing.

    Returns:
        Its links.
    """
    bodies = model.pin if payloads is None else model.bare
    turns = [turn_of(bodies, i) for i in range(1, bodies.njoints)]
    links = [_link(bodies, i, turns) for i in range(1, bodies.njoints)]
    for place, payload in zip(model.scene.payloads, payloads or (), strict=payloads is not None):
        _load(links, turns, bodies.frames[bodies.getFrameId(place.frame)], payload)
    if regroup:
        for i in reversed(range(len(links))):
            _regroup(links, i)
    return Tree(tuple(links), np.array(model.pin.armature), model.followers, model.offsets)


def gravity_of(model: ArmModel) -> ca.SX:
    """The scene's gravity in [m/s²] as an expression in which zeros vanish, shape (3,)."""
    return constant(np.array(model.scene.gravity, dtype=float))


def skew(x: ca.SX) -> ca.SX:
    """Matrix of the cross product with ``x``."""
    rows = ca.horzcat(0, -x[2], x[1]), ca.horzcat(x[2], 0, -x[0]), ca.horzcat(-x[1], x[0], 0)
    return ca.sparsify(ca.vertcat(*rows))


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    """Cross product that keeps zeros."""
    return ca.sparsify(skew(a) @ b)


def symmetric(X: ca.SX) -> ca.SX:
    """The upper triangle of a symmetric matrix, mirrored, so that no entry is computed twice."""
    return ca.sparsify(ca.triu2symm(ca.triu(X)))


def moved(R: ca.SX, p: ca.SX, m: ca.SX, h: ca.SX, inertia: ca.SX) -> tuple[ca.SX, ca.SX]:
    """First moment and inertia of a body in another frame (parallel axes).

    Args:
        R: Rotation from the body's axes to the new ones, shape (3, 3).
        p: The body frame's origin in the new frame in [m], shape (3,).
        m: Mass in [kg].
        h: First moment in the body's frame in [kg m], shape (3,).
        inertia: Inertia about the body frame's origin in [kg m²], shape (3, 3).

    Returns:
        First moment, shape (3,), and inertia about the new origin, shape (3, 3).
    """
    s, P = R @ h, skew(p)
    shifted = P @ skew(s)
    turned = symmetric(R @ inertia @ R.T) - symmetric(shifted + shifted.T + m * (P @ P))
    return ca.sparsify(s + m * p), ca.sparsify(turned)


def spread_map(tree: Tree) -> ca.SX:
    """The map E from independent joints to links."""
    return sparse(tree.followers)


def turn_of(model: pin.Model, i: int) -> tuple[Array, bool]:
    """Rotation that brings z onto the axis of joint ``i``, and whether the joint slides."""
    S = np.array(model.joints[i].createData().S).ravel()
    prismatic = bool(np.linalg.norm(S[:3]) > 0.5)
    z = S[:3] if prismatic else S[3:]
    # Start x from the basis vector after the axis' largest entry: then a coordinate axis gives a
    # cyclic permutation of the axes.
    x = np.roll(np.eye(3)[np.argmax(abs(z))], 1)
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z]), prismatic


def _link(model: pin.Model, i: int, turns: list[tuple[Array, bool]]) -> Link:
    T, prismatic = turns[i - 1]
    parent = model.parents[i] - 1
    T_parent = turns[parent][0] if parent >= 0 else np.eye(3)
    place, body = model.jointPlacements[i], model.inertias[i]
    c = T.T @ body.lever
    inertia = T.T @ body.inertia @ T - body.mass * _hat(c) @ _hat(c)
    return Link(
        parent,
        prismatic,
        R=clean(T_parent.T @ place.rotation @ T),
        p=clean(T_parent.T @ place.translation),
        m=ca.SX(body.mass),
        h=sparse(body.mass * c),
        I=sparse((inertia + inertia.T) / 2),
    )


def _load(
    links: list[Link], turns: list[tuple[Array, bool]], frame: pin.Frame, payload: ca.SX
) -> None:
    """Add a symbolic body that sits in ``frame`` to the link that carries the frame."""
    if frame.parentJoint == 0:
        return
    T = turns[frame.parentJoint - 1][0]
    R, p = sparse(T.T @ frame.placement.rotation), sparse(T.T @ frame.placement.translation)
    m, com, (xx, xy, xz, yy, yz, zz) = payload[0], payload[1:4], ca.vertsplit(payload[4:10])
    about_com = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    h, inertia = moved(R, p, m, m * com, about_com - m * skew(com) @ skew(com))
    link = links[frame.parentJoint - 1]
    link.m, link.h, link.I = link.m + m, link.h + h, link.I + inertia


def _regroup(links: list[Link], i: int) -> None:
    """Move to the parent what joint ``i`` cannot tell from the parent's inertia."""
    link = links[i]
    if link.prismatic:
        m, h, inertia = ca.SX(0), ca.SX(3, 1), ca.SX(link.I)
        link.I = ca.SX(3, 3)
    else:
        round_part = link.I[1, 1]
        m, h = link.m, ca.vertcat(0, 0, link.h[2])
        inertia = ca.diag(ca.vertcat(round_part, round_part, 0))
        link.m, link.h = ca.SX(0), ca.sparsify(ca.vertcat(link.h[0], link.h[1], 0))
        link.I = ca.sparsify(link.I - inertia)
    if link.parent >= 0:
        _add(links[link.parent], link, m, h, inertia)


def _add(parent: Link, child: Link, m: ca.SX, h: ca.SX, inertia: ca.SX) -> None:
    """Add an inertia given in the child's frame at q = 0 to the parent (parallel axes)."""
    h_moved, inertia_moved = moved(sparse(child.R), sparse(child.p), m, h, inertia)
    parent.m = parent.m + m
    parent.h = ca.sparsify(parent.h + h_moved)
    parent.I = ca.sparsify(parent.I + inertia_moved)


def _hat(x: Array) -> Array:
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def clean(values: Array) -> Array:
    """Put entries that are 0, 1 or -1 but for rounding there."""
    cleaned = np.array(values)
    for exact in (0.0, 1.0, -1.0):
        cleaned[abs(cleaned - exact) < DIRT] = exact
    return cleaned


def constant(values: Array) -> ca.SX:
    """Numbers as an expression in which zeros vanish."""
    return ca.sparsify(ca.SX(ca.DM(values)))


def sparse(values: Array) -> ca.SX:
    """Numbers as an expression from which zeros, and dirt in their place, have vanished."""
    return constant(clean(values))
