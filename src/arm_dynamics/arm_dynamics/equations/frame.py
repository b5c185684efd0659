# SPDX-License-Identifier: Apache-2.0
"""Motion of one frame of a tree, in world axes at the frame's origin, linear part first.

Also the relative placement of two frames.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from arm_dynamics.arrays import Array
from arm_dynamics.equations import rigid_body
from arm_dynamics.equations.tree import (
    Tree,
    common_link,
    constant,
    cross,
    links_between,
    spread_map,
)


@dataclass(frozen=True)
class Frame:
    """A frame fixed to a link or to the ground.

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
    if frame.link < 0:
        return constant(frame.p), constant(frame.R)
    R, p = _link_placements(tree, q)[frame.link]
    return p + R @ constant(frame.p), R @ constant(frame.R)


def rotation_vector(R: ca.SX) -> ca.SX:
    """Axis times angle of a rotation in [rad], shape (3,); not a number beyond 150°.

    There the angle's sine says little about the axis; see ``pinocchio.log3`` for all angles.

    Source: Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994,
    equations (2.17) and (2.18).

    Args:
        R: Rotation matrix, shape (3, 3).
    """
    axis = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / 2
    sine, cosine = ca.sqrt(ca.sumsqr(axis)), (ca.trace(R) - 1) / 2
    ratio = ca.if_else(sine > 0, ca.atan2(sine, cosine) / sine, 1)
    return ca.if_else(cosine > -math.sqrt(0.75), ratio * axis, math.nan)


def jacobian(tree: Tree, frame: Frame, q: ca.SX) -> ca.SX:
    """J of shape (6, n): velocities of the frame are J v.

    A revolute joint with axis z and origin o gives the column (z x (p - o), z), a prismatic one
    (z, 0) (Craig, Introduction to Robotics, section 5.7).
    """
    placed, (p, _) = _link_placements(tree, q), placement(tree, frame, q)
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


def derivative(J: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    """J̇ = Σ ∂J/∂q_i v_i, shape of ``J``."""
    return ca.reshape(ca.jtimes(ca.vec(J), q, v), *J.shape)


def drift(J: ca.SX, q: ca.SX, v: ca.SX) -> ca.SX:
    """J̇ v, the acceleration at zero joint acceleration, shape (m,)."""
    return ca.jtimes(J @ v, q, v)


def relative(
    tree: Tree,
    pose: Sequence[rigid_body.Placement],
    frames: Sequence[Frame],
    points: Sequence[Sequence[float]],
) -> tuple[ca.SX, ca.SX]:
    """Rotation of a first frame in a second; a point of the first relative to one of the second.

    Joints that move both frames do not enter.

    Args:
        tree: The links.
        pose: Their placements, as from ``rigid_body.placements``.
        frames: The two frames.
        points: A point of each, in its own axes, in [m].

    Returns:
        Shape (3, 3), and in axes of the second frame in [m], shape (3,).
    """
    first, second = frames
    a, b = (ca.SX(ca.DM(point)) for point in points)
    common = common_link(tree, first.link, second.link)
    R_a, p_a = _in_carrier(tree, pose, first, ca.sparsify(a), common)
    R_b, p_b = _in_carrier(tree, pose, second, ca.sparsify(b), common)
    return ca.sparsify(R_b.T @ R_a), ca.sparsify(R_b.T @ (p_a - p_b))


def _in_carrier(
    tree: Tree, pose: Sequence[rigid_body.Placement], frame: Frame, point: ca.SX, ancestor: int
) -> tuple[ca.SX, ca.SX]:
    """Rotation of a frame, and a point of it, in the axes of a link that carries it."""
    R = constant(frame.R)
    p = constant(frame.p) + R @ point
    for link in links_between(tree, frame.link, ancestor):
        here = pose[link]
        R, p = ca.sparsify(here.R @ R), ca.sparsify(here.R @ p + here.p)
    return R, p


def _link_placements(tree: Tree, q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """Rotation and origin of every link in the world."""
    placed: list[tuple[ca.SX, ca.SX]] = []
    for link, here in zip(tree.links, rigid_body.placements(tree, q), strict=True):
        if link.parent < 0:
            placed.append((here.R, here.p))
        else:
            R, p = placed[link.parent]
            placed.append((ca.sparsify(R @ here.R), ca.sparsify(p + R @ here.p)))
    return placed
