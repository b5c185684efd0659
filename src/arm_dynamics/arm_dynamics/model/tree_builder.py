# SPDX-License-Identifier: Apache-2.0
"""A robot in the form that the equations use: links, frames, constraints and contacts.

Every joint frame is rotated such that its axis is z; a frame of the robot is described in the
rotated axes of the link that carries it.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.equations.constraint import Linkage, across
from arm_dynamics.equations.contact import ContactPoint
from arm_dynamics.equations.frame import Frame
from arm_dynamics.equations.tree import Link, Tree, clean, constant, moved, regrouped, skew, sparse
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.robot import Robot
from arm_dynamics.scene.constraint import CouplingConstraint, FrameConstraint


def tree_of(robot: Robot, payloads: Sequence[ca.SX] | None = None, regroup: bool = True) -> Tree:
    """Describe a robot's links.

    Args:
        robot: The robot.
        payloads: Symbols that replace the scene's payloads: mass, centre of mass (3) and inertia
            (6) of each.
        regroup: Whether to move inertia to parent links where that leaves the dynamics unchanged.

    Returns:
        Its links.
    """
    bodies = robot.pin if payloads is None else robot.bare
    turns = [_turn(bodies, i) for i in range(1, bodies.njoints)]
    links = [_link(bodies, i, turns, robot.reach) for i in range(1, bodies.njoints)]
    for place, payload in zip(robot.scene.payloads, payloads or (), strict=payloads is not None):
        _load(links, frame_of(robot, place.frame), payload)
    if regroup:
        regrouped(links)
    return Tree(tuple(links), np.array(robot.pin.armature), robot.followers, robot.offsets)


def gravity_of(robot: Robot) -> ca.SX:
    """The scene's gravity in [m/s²] as an expression in which zeros vanish, shape (3,)."""
    return constant(np.array(robot.scene.gravity, dtype=float))


def frame_of(robot: Robot, name: str) -> Frame:
    """Describe a frame or ``world``; one that no joint moves belongs to the ground, link -1."""
    frame = robot.frame(name)
    R, p = frame.placement.rotation, frame.placement.translation
    if frame.parentJoint > 0:
        turn, _ = _turn(robot.pin, frame.parentJoint)
        R, p = turn.T @ R, turn.T @ p
    return Frame(frame.parentJoint - 1, clean(R), clean(p, robot.reach))


def linkage_of(robot: Robot, kept: Mapping[int, Sequence[int]]) -> Linkage:
    """Describe the scene's bilateral constraints.

    Args:
        robot: The robot.
        kept: Independent rows of each constraint, by its index.
    """
    constraints = robot.scene.bilateral
    tied = [c.frames for c in constraints.values() if not isinstance(c, CouplingConstraint)]
    frames = {name: frame_of(robot, name) for pair in tied for name in pair}
    return Linkage(constraints, frames, robot.joint_names, kept)


def contact_points(robot: Robot) -> list[ContactPoint]:
    """Describe the scene's contacts.

    Raises:
        SceneError: If a contact's frame does not move relative to its plane.
    """
    points = []
    for name, contact in robot.scene.contacts:
        plane = contact.plane
        frame, carrier = frame_of(robot, contact.frame), frame_of(robot, plane.frame)
        if carrier.link in _one_body(robot, frame.link):
            raise SceneError(
                f"contact '{name}': no joint moves its frame '{contact.frame}' relative to its "
                f"plane's frame '{plane.frame}'; frames of two bodies are expected"
            )
        normal = carrier.R @ np.array(plane.normal)
        point = ContactPoint(
            name,
            frame.link,
            place=frame.R @ np.array(contact.point) + frame.p,
            radius=contact.radius,
            carrier=carrier.link,
            axes=np.vstack([normal, across(normal)]),
            offset=float(normal @ (carrier.R @ np.array(plane.point) + carrier.p)),
            friction=contact.friction,
            static_friction=contact.sticking,
            restitution=contact.restitution,
        )
        points.append(point)
    return points


def _one_body(robot: Robot, link: int) -> set[int]:
    """Links rigidly connected to a link by permanent constraints, itself included."""
    welds = [
        {frame_of(robot, frame).link for frame in weld.frames}
        for weld in robot.scene.bilateral.values()
        if isinstance(weld, FrameConstraint) and not weld.switchable
    ]
    body = {link}
    for _ in welds:
        body = body.union(*(weld for weld in welds if weld & body))
    return body


def _turn(model: pin.Model, i: int) -> tuple[Array, bool]:
    """Rotation that maps z to the axis of joint ``i``, and whether the joint is prismatic."""
    S = np.array(model.joints[i].createData().S).ravel()
    prismatic = bool(np.linalg.norm(S[:3]) > 0.5)
    z = S[:3] if prismatic else S[3:]
    return np.column_stack([*across(z), z]), prismatic


def _link(model: pin.Model, i: int, turns: list[tuple[Array, bool]], reach: float) -> Link:
    T, prismatic = turns[i - 1]
    parent = model.parents[i] - 1
    T_parent = turns[parent][0] if parent >= 0 else np.eye(3)
    place, body = model.jointPlacements[i], model.inertias[i]
    c = T.T @ body.lever
    inertia = T.T @ body.inertia @ T - body.mass * pin.skew(c) @ pin.skew(c)
    return Link(
        parent,
        prismatic,
        R=clean(T_parent.T @ place.rotation @ T),
        p=clean(T_parent.T @ place.translation, reach),
        m=ca.SX(body.mass),
        h=sparse(body.mass * c, body.mass * reach),
        I=sparse((inertia + inertia.T) / 2, body.mass * reach**2),
    )


def _load(links: list[Link], frame: Frame, payload: ca.SX) -> None:
    """Add a symbolic body attached to ``frame`` to the link that carries the frame."""
    if frame.link < 0:
        return
    m, com, (xx, xy, xz, yy, yz, zz) = payload[0], payload[1:4], ca.vertsplit(payload[4:10])
    about_com = ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    about_origin = about_com - m * skew(com) @ skew(com)
    h, inertia = moved(constant(frame.R), constant(frame.p), m, m * com, about_origin)
    link = links[frame.link]
    link.m, link.h, link.I = link.m + m, link.h + h, link.I + inertia
