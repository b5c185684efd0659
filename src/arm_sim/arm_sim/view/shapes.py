# SPDX-License-Identifier: Apache-2.0
"""Shapes of a robot: the visuals of its URDF, else capsules with its links' inertia."""

import logging
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.robot import Robot
from arm_dynamics.scene.files import find_file
from arm_dynamics.scene.urdf.xml import xml_root

_log = logging.getLogger(__name__)

# Red, green, blue and opacity, 0 to 1
type Colour = tuple[float, ...]

METAL: Colour = (0.36, 0.47, 0.6, 1.0)  # links without a mesh
LOAD: Colour = (0.93, 0.55, 0.15, 1.0)  # payloads and point masses
SURFACE: Colour = (0.45, 0.6, 0.75, 0.35)  # planes of contacts
TOUCH: Colour = (0.15, 0.35, 0.6, 1.0)  # contact points
BEARING: Colour = (0.25, 0.27, 0.3, 1.0)  # pivots and rails
PIVOT, RAIL = "pivot", "rail"  # names of what is drawn in place of a base
DENSITY = 1000.0  # [kg/m³] of the balls that represent payloads and point masses
THIN, THICK = 0.016, 0.08  # least and largest radius of capsules, relative to the robot's reach


class Visual(NamedTuple):
    """A shape that is fixed to a joint's body."""

    name: str  # of the link, payload or plane that it shows
    joint: int  # number of Pinocchio's joint that carries it; 0 is the world
    placement: pin.SE3  # in the joint's frame; of solids, of their middle
    kind: str  # box, cylinder, capsule (both along z), sphere or mesh
    size: tuple[float, ...]  # of solids: of the box around them in [m]; of meshes: their scale
    colour: Colour | None = None  # None for that of the file, if any
    path: Path | None = None  # of a mesh

    @property
    def corners(self) -> Array:
        """Corners of the box around it, in the frame of its joint, shape (8, 3).

        For a mesh, whose size is in its file, only its position.
        """
        size = np.zeros(3) if self.kind == "mesh" else np.array(self.size)
        signs = np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3), axis=-1).reshape(-1, 3)
        return np.array([self.placement.act(corner) for corner in signs * size])


def visuals_of(robot: Robot, folder: Path | None = None) -> tuple[Visual, ...]:
    """All constant shapes of a robot: links, payloads, planes and balls; pivots without a base.

    A missing mesh causes a warning, and its link is drawn as a capsule. Meshes with relative names
    are in ``folder``, or the current one.
    """
    links = list(_described(robot, folder or Path.cwd()))
    with_visuals = {visual.joint for visual in links}
    bare = [joint for joint in range(1, robot.pin.njoints) if joint not in with_visuals]
    pivots = () if 0 in with_visuals else _pivots(robot)
    return (*links, *capsules_of(robot, bare), *pivots, *_payloads(robot), *_contacts(robot))


# --- the URDF's visuals ----------------------------------------------------------------------


def _described(robot: Robot, folder: Path) -> Iterable[Visual]:
    """The visuals in the robot's description; those that cannot be drawn are left out."""
    root = xml_root(robot.scene.robot.urdf)
    materials = root.findall("material")
    colours = {material.get("name"): _colour(material, {}) for material in materials}
    for link in root.findall("link"):
        name = str(link.get("name"))
        frame = robot.frame(name)
        for visual in link.findall("visual"):
            try:
                shape = _shape(visual.find("geometry"), folder)
                placement = frame.placement * _origin(visual.find("origin"))
                colour = _colour(visual.find("material"), colours)
            except (SceneError, ValueError) as error:
                _log.warning("link '%s' is drawn without one of its visuals: %s", name, error)
                continue
            yield Visual(name, frame.parentJoint, placement, *shape[:2], colour, *shape[2:])


def _shape(geometry: ElementTree.Element | None, folder: Path) -> tuple[str, Colour, Path | None]:
    """Kind, size and file of a visual."""
    if geometry is None or not len(geometry):
        raise ValueError("its <geometry> is empty")
    element, path = geometry[0], None
    round_ = 2 * float(element.get("radius", "nan"))
    if (kind := element.tag) == "mesh":
        size = _numbers(element.get("scale", "1 1 1"))
        path = find_file(element.get("filename", ""), folder)
    elif kind == "box":
        size = _numbers(element.get("size", ""))
    elif kind in ("cylinder", "capsule"):
        size = round_, round_, float(element.get("length", ""))
    elif kind == "sphere":
        size = round_, round_, round_
    else:
        raise ValueError(f"<{kind}>; allowed: mesh, box, cylinder, capsule, sphere")
    if len(size) != 3 or not np.isfinite(size).all():
        raise ValueError(f"the size of its <{kind}> is not known")
    return kind, size, path


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split()))


def _origin(element: ElementTree.Element | None) -> pin.SE3:
    if element is None:
        return pin.SE3.Identity()
    (roll, pitch, yaw), place = (_numbers(element.get(key, "0 0 0")) for key in ("rpy", "xyz"))
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(place))


def _colour(
    material: ElementTree.Element | None, named: dict[str | None, Colour | None]
) -> Colour | None:
    """The colour of a material, its own or that of its name; None if it has none."""
    if material is None:
        return None
    if (element := material.find("color")) is None:
        return named.get(material.get("name"))
    r, g, b, a = _numbers(element.get("rgba", ""))
    return r, g, b, a


# --- links without visuals -------------------------------------------------------------------


def capsules_of(robot: Robot, joints: Iterable[int]) -> list[Visual]:
    """Bodies of joints as capsules of the same inertia, with thin ones to the next joints.

    A cylinder of mass m, radius r and length l has m r²/2 about its axis and m (3 r² + l²)/12
    across (Goldstein, Classical Mechanics, section 5.3); these are solved for r and l, with the
    mean of the two larger moments as the transverse one, and the ends are rounded. Point masses
    are balls, and hinges between bodies dark pins.
    """
    model, size = robot.bare, robot.reach
    thin, visuals = THIN * size, []

    def add(
        joint: int, kind: str, along: Array, middle: Array, wide: float, length: float,
        colour: Colour = METAL,
    ) -> None:  # fmt: skip
        place, box = pin.SE3(turn_to(along), middle), (wide, wide, length)
        visuals.append(Visual(model.names[joint], joint, place, kind, box, colour))

    for joint in joints:
        body = model.inertias[joint]
        if body.mass > 0.0:
            moments, axes = np.linalg.eigh(body.inertia)
            along, across = max(float(moments[0]), 0.0), float(moments[1:].mean())
            radius = np.sqrt(2 * along / body.mass)
            length = np.sqrt(max(12 * across / body.mass - 3 * radius**2, 0.0))
            if max(radius, length) < thin:
                wide = 2 * float(np.clip(_ball(body.mass), 3 * thin, THICK * size))
                add(joint, "sphere", axes[:, 0], body.lever, wide, wide)
            else:
                wide = 2 * float(np.clip(radius, thin, THICK * size))
                add(joint, "capsule", axes[:, 0], body.lever, wide, float(length))
        ways = [model.jointPlacements[child].translation for child in model.children[joint]]
        axis = np.asarray(model.joints[joint].createData().S).ravel()[3:]
        if model.parents[joint] and axis.any():
            add(joint, "cylinder", axis, np.zeros(3), 3 * thin, 6 * thin, BEARING)
        for way in ways or [body.lever]:
            if (length := float(np.linalg.norm(way))) > thin:
                add(joint, "capsule", way, way / 2, 2 * thin, length)
    return visuals


def _ball(mass: float) -> float:
    """Radius of the ball that represents a mass."""
    return float((3 * mass / (4 * np.pi * DENSITY)) ** (1 / 3))


def turn_to(direction: Array) -> Array:
    """A rotation that maps z to a direction, shape (3, 3)."""
    z = np.array([0.0, 0.0, 1.0])
    turn: Array = pin.Quaternion.FromTwoVectors(z, np.asarray(direction, dtype=float)).matrix()
    return turn


def _pivots(robot: Robot) -> Iterable[Visual]:
    """Axles of joints that the world carries, and rails of those that slide, as far as they do."""
    model, size = robot.bare, robot.reach
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            slide, turn = np.asarray(model.joints[joint].createData().S).reshape(2, 3)
            at, slides = model.joints[joint].idx_q, slide.any()
            low, high = model.lowerPositionLimit[at], model.upperPositionLimit[at]
            far, thick = (2.0, 0.3 * THIN) if slides else (0.8 * THICK, 1.5 * THIN)
            if slides and low < high:
                low, high = np.clip([low, high], -far * size, far * size)
            else:
                low, high = -far * size, far * size
            place = pin.SE3(turn_to(slide + turn), (low + high) / 2 * slide)
            yield Visual(
                RAIL if slides else PIVOT, 0, model.jointPlacements[joint] * place, "cylinder",
                (2 * thick * size, 2 * thick * size, float(high - low)), BEARING,
            )  # fmt: skip


# --- additions of the scene ---------------------------------------------------------------------


def _payloads(robot: Robot) -> Iterable[Visual]:
    for i, payload in enumerate(robot.scene.payloads):
        joint, place = _in_joint(robot, payload.frame, payload.com)
        radius = _ball(payload.mass)
        if radius > 0.0:
            yield Visual(f"payload_{i}", joint, place, "sphere", 3 * (2 * radius,), LOAD)


def _contacts(robot: Robot) -> Iterable[Visual]:
    """Points or balls of contacts, and a part of each plane."""
    size, planes = robot.reach, set()
    for name, contact in robot.scene.contacts:
        joint, place = _in_joint(robot, contact.frame, contact.point)
        radius = contact.radius or THIN * size
        yield Visual(name, joint, place, "sphere", 3 * (2 * radius,), TOUCH)
        if contact.plane not in planes:
            planes.add(contact.plane)
            joint, place = _in_joint(robot, contact.plane.frame, contact.plane.point)
            place.rotation = turn_to(place.rotation @ np.array(contact.plane.normal))
            wide = (0.96 if joint == 0 else 0.32) * size
            yield Visual(f"{name}_plane", joint, place, "box", (wide, wide, 2e-4 * size), SURFACE)


def _in_joint(robot: Robot, name: str, point: Iterable[float]) -> tuple[int, pin.SE3]:
    """The joint that carries a point of a frame or of the world, and its position there."""
    frame, offset = robot.frame(name), pin.SE3(np.eye(3), np.array(list(point)))
    return frame.parentJoint, frame.placement * offset
