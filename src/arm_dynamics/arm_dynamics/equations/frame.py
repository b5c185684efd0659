# SPDX-License-Identifier: Apache-2.0
"""Motion of one frame of a tree, in the axes of the world at the frame's origin, linear first."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from arm_dynamics.arrays import Array
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.tree import Tree, constant, cross, spread_map


@dataclass(frozen=True)
class Frame:
    """A frame that a link, or the ground, carries.

    Attributes:
        link: Index of the link, -1 for the ground.
        R: Rotation from the frame's axes to those of the link, shape (3, 3).
        p: Origin in the link's frame in [m], shape (3,).
    """

    link: int
    R: Array
    p: Array


def placement(tree: Tree, frame: Frame, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Position in [m], shape (3,), and rotation, shape (3, 3), of a frame in the world."""
    R, p = _placed(tree, q)[frame.link]
    return p + R @ constant(frame.p), R @ constant(frame.R)


def jacobian(tree: Tree, frame: Frame, q: ca.SX) -> ca.SX:
    """J of shape (6, n): velocities of the frame are J v.

    A turning joint with axis z and origin o gives the column (z x (p - o), z), a sliding one
    (z, 0) (Craig, Introduction to Robotics, section 5.7).
    """
    placed, (p, _) = _placed(tree, q), placement(tree, frame, q)
    J = ca.SX(6, len(tree.links))
    i = frame.link
    while i >= 0:
        (R, origin), link = placed[i], tree.links[i]
        z = R[:, 2]
        J[:3, i] = z if link.prismatic else cross(z, p - origin)
        if not link.prismatic:
            J[3:, i] = z
        i = link.parent
    return J @ spread_map(tree)


def drift(J: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    """J̇ v, the acceleration that is there without joint acceleration, shape (m,)."""
    return ca.jtimes(J @ v, q, v)


def _placed(tree: Tree, q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """Rotation and origin of every link in the world."""
    placed: list[tuple[ca.SX, ca.SX]] = []
    for link, here in zip(tree.links, rigid_body.placements(tree, q), strict=True):
        if link.parent < 0:
            placed.append((here.R, here.p))
        else:
            R, p = placed[link.parent]
            placed.append((ca.sparsify(R @ here.R), ca.sparsify(p + R @ here.p)))
    return placed
