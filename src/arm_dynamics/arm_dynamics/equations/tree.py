# SPDX-License-Identifier: Apache-2.0
"""A robot's links in the form that gives the shortest equations of motion.

Two exact transformations are made before any equation is built:

* every joint frame is rotated such that its axis is z;
* inertia that is indistinguishable from the parent's is moved to the parent (base inertial
  parameters: Gautier and Khalil, "Direct calculation of minimum set of inertial parameters of
  serial robots", IEEE Trans. Robotics and Automation 6(3), 1990). A body that is symmetric about a
  revolute axis and has no inertia about it has the same effect whether the joint turns or not; so
  has the rotational inertia of a body on a prismatic joint. The parameters of a single link may
  thus be unphysical, but no torque or acceleration changes, and many products vanish.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations.elementary import Quantity

# Products of rotations by multiples of 90 degrees leave rounding errors, which would prevent the
# simplification of factors.
ROUNDING = 1e-15
# Inverse of the size below which they are less than that.
LEAST_RATIO = 1e3


@dataclass
class Link:
    """One moving link; all quantities in its joint frame, whose z is the joint's axis.

    Attributes:
        parent: Index of the parent link, -1 for the ground.
        prismatic: Whether the joint is prismatic along z rather than revolute about it.
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
    """Links, parents before children, with the constants of their joints.

    Attributes:
        links: One for each of Pinocchio's joints.
        armature: Drive inertia of each joint in [kg m²] or [kg], shape (n,).
        followers: Map E from independent velocities to those of the links, shape (links, n).
        offsets: Offset e of the link positions in [rad] or [m], shape (links,).
    """

    links: tuple[Link, ...]
    armature: Array
    followers: Array
    offsets: Array

    @property
    def has_followers(self) -> bool:
        """Whether there are mimic joints."""
        return bool(self.followers.shape[0] != self.followers.shape[1])


def common_link(tree: Tree, i: int, j: int) -> int:
    """The nearest link that carries both, -1 for the ground."""
    while i != j:
        if i > j:
            i = tree.links[i].parent
        else:
            j = tree.links[j].parent
    return i


def links_between(tree: Tree, i: int, below: int) -> list[int]:
    """Links from ``i`` down to the child of its ancestor ``below``; none if both are the same."""
    chain = []
    while i != below:
        chain.append(i)
        i = tree.links[i].parent
    return chain


def skew(x: ca.SX) -> ca.SX:
    """Matrix of the cross product with ``x``."""
    rows = ca.horzcat(0, -x[2], x[1]), ca.horzcat(x[2], 0, -x[0]), ca.horzcat(-x[1], x[0], 0)
    return ca.sparsify(ca.vertcat(*rows))


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    """Cross product that preserves structural zeros."""
    return ca.sparsify(skew(a) @ b)


def symmetric(X: ca.SX) -> ca.SX:
    """Symmetric matrix from its upper triangle, such that no entry is computed twice."""
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


def regrouped(links: list[Link]) -> None:
    """Move, from the leaves down, inertia that is indistinguishable from the parent's."""
    for link in reversed(links):
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
            parent = links[link.parent]
            h_moved, inertia_moved = moved(constant(link.R), constant(link.p), m, h, inertia)
            parent.m = parent.m + m
            parent.h = ca.sparsify(parent.h + h_moved)
            parent.I = ca.sparsify(parent.I + inertia_moved)


def spread_map(tree: Tree) -> ca.SX:
    """The map E from independent joints to links; the identity without mimic joints."""
    return sparse(tree.followers)


def clean(values: Array, size: float = 1.0) -> Array:
    """Round entries that are 0, 1 or -1 up to rounding errors.

    Args:
        values: Entries that rounding errors may be added to.
        size: Size of the quantities that they are derived from, in their unit; the errors of large
            ones are not looked for, those of small ones are smaller.
    """
    cleaned = np.array(values)
    for exact in (0.0, 1.0, -1.0):
        cleaned[abs(cleaned - exact) < ROUNDING * min(1.0, LEAST_RATIO * size)] = exact
    return cleaned


def constant(values: Array) -> ca.SX:
    """Numbers as an expression with structural zeros."""
    return ca.sparsify(ca.SX(ca.DM(values)))


def like(x: Quantity) -> Any:
    """Converter of coefficients to the type of ``x``; zeros vanish from an expression."""
    return constant if isinstance(x, ca.SX) else np.asarray


def sparse(values: Array, size: float = 1.0) -> ca.SX:
    """Numbers as an expression without zeros, rounding errors of zero included; see ``clean``."""
    return constant(clean(values, size))
