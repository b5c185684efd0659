# SPDX-License-Identifier: Apache-2.0
"""Shapes of a robot: the visuals of its URDF, else capsules with its links' inertia."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.robot import Robot
from arm_dynamics.scene.files import find_file
from arm_dynamics.scene.urdf import xml_root

_log = logging.getLogger(__name__)

type Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""

METAL: Colour = (0.72, 0.74, 0.78, 1.0)
LOAD: Colour = (0.93, 0.55, 0.15, 1.0)
SURFACE: Colour = (0.45, 0.6, 0.75, 0.35)
TOUCH: Colour = (0.15, 0.35, 0.6, 1.0)
BEARING: Colour = (0.25, 0.27, 0.3, 1.0)
PIVOT, RAIL = "pivot", "rail"  # names of what is drawn in place of a base
LOAD_DENSITY = 1000.0  # [kg/m³] of the balls that represent payloads
THIN, THICK = 0.012, 0.08  # least and largest radius of capsules, relative to the robot's reach


@dataclass(frozen=True)
class Mesh:
    """A scaled mesh file; colours and textures are those of the file."""

    path: Path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Box:
    """A box about its middle, of ``size`` in [m]."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """A cylinder about its middle, along z, in [m]; with ``rounded`` ends it is a capsule."""

    radius: float
    length: float
    rounded: bool = False


@dataclass(frozen=True)
class Sphere:
    """A ball of a radius in [m]."""

    radius: float


type Shape = Mesh | Box | Cylinder | Sphere


@dataclass(frozen=True)
class Visual:
    """A shape that is fixed to a joint's body.

    Attributes:
        name: The link, payload or plane that it shows.
        joint: Number of Pinocchio's joint that carries it; 0 is the world.
        placement: Its placement in the joint's frame.
        shape: The shape.
        colour: Its colour; None for that of the file, if any.
    """

    name: str
    joint: int
    placement: pin.SE3
    shape: Shape
    colour: Colour | None = None


def visuals_of(robot: Robot, folder: Path | None = None) -> tuple[Visual, ...]:
    """All constant shapes of a robot: links, payloads, planes and balls; pivots without a base.

    A missing mesh causes a warning, and its link is drawn as a capsule.

    Args:
        robot: The robot.
        folder: Folder of meshes with relative names; None for the current one.
    """
    links = list(_described(robot, folder or Path.cwd()))
    drawn = {visual.joint for visual in links}
    bare = [joint for joint in range(1, robot.pin.njoints) if joint not in drawn]
    pivots = () if 0 in drawn else _pivots(robot)
    return (*links, *capsules_of(robot, bare), *pivots, *_payloads(robot), *_contacts(robot))


def corners(visual: Visual) -> Array:
    """Corners of the box around a solid, in the frame of the joint that carries it, shape (8, 3).

    For a mesh, whose size is in its file, only its position.
    """
    shape = visual.shape
    if isinstance(shape, Box):
        size = shape.size
    elif isinstance(shape, Cylinder):
        size = 2 * shape.radius, 2 * shape.radius, shape.length
    else:
        size = (2 * shape.radius if isinstance(shape, Sphere) else 0.0,) * 3
    signs = np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3), axis=-1).reshape(-1, 3)
    return np.array([visual.placement.act(corner) for corner in signs * size])


# --- the URDF's visuals ----------------------------------------------------------------------


def _described(robot: Robot, folder: Path) -> Iterable[Visual]:
    root = xml_root(robot.scene.robot.urdf)
    colours = {
        material.get("name"): _colour(material, {}) for material in root.findall("material")
    }
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
            yield Visual(name, frame.parentJoint, placement, shape, colour)


def _shape(geometry: ElementTree.Element | None, folder: Path) -> Shape:
    element = geometry[0] if geometry is not None and len(geometry) else None
    if element is None:
        raise ValueError("its <geometry> is empty")
    numbers = {key: element.get(key, "") for key in ("radius", "length", "size", "scale")}
    if element.tag == "mesh":
        scale = _three(numbers["scale"] or "1 1 1")
        return Mesh(find_file(element.get("filename", ""), folder), scale)
    if element.tag == "box":
        return Box(_three(numbers["size"]))
    if element.tag in ("cylinder", "capsule"):
        rounded = element.tag == "capsule"
        return Cylinder(float(numbers["radius"]), float(numbers["length"]), rounded)
    if element.tag == "sphere":
        return Sphere(float(numbers["radius"]))
    raise ValueError(f"<{element.tag}>; allowed: mesh, box, cylinder, capsule, sphere")


def _three(text: str) -> tuple[float, float, float]:
    x, y, z = map(float, text.split())
    return x, y, z


def _origin(element: ElementTree.Element | None) -> pin.SE3:
    if element is None:
        return pin.SE3.Identity()
    turn = pin.rpy.rpyToMatrix(*_three(element.get("rpy", "0 0 0")))
    return pin.SE3(turn, np.array(_three(element.get("xyz", "0 0 0"))))


def _colour(
    material: ElementTree.Element | None, named: dict[str | None, Colour | None]
) -> Colour | None:
    if material is None:
        return None
    element = material.find("color")
    if element is None:
        return named.get(material.get("name"))
    r, g, b, a = map(float, element.get("rgba", "").split())
    return r, g, b, a


# --- links without visuals -------------------------------------------------------------------


def capsules_of(robot: Robot, joints: Iterable[int]) -> list[Visual]:
    """Bodies of joints as capsules of the same inertia, with thin ones to the next joints.

    A cylinder of mass m, radius r and length l has m r²/2 about its axis and m (3 r² + l²)/12
    across (Goldstein, Classical Mechanics, section 5.3); these are solved for r and l, with the
    mean of the two larger moments as the transverse one, and the ends are rounded.

    Args:
        robot: The robot.
        joints: Pinocchio's numbers of the joints.
    """
    model, size = robot.bare, robot.reach
    visuals = []
    for joint in joints:
        body, name = model.inertias[joint], model.names[joint]
        if body.mass > 0.0:
            visuals.append(Visual(name, joint, *_capsule(body, size), METAL))
        ways = [
            model.jointPlacements[child].translation
            for child in range(1, model.njoints)
            if model.parents[child] == joint
        ]
        for way in ways or [body.lever]:
            if (length := float(np.linalg.norm(way))) > THIN * size:
                placement = pin.SE3(_along(way), way / 2)
                bone = Cylinder(THIN * size, length, rounded=True)
                visuals.append(Visual(name, joint, placement, bone, METAL))
    return visuals


def _capsule(body: pin.Inertia, size: float) -> tuple[pin.SE3, Cylinder]:
    moments, axes = np.linalg.eigh(body.inertia)
    along, across = max(float(moments[0]), 0.0), float(moments[1:].mean())
    radius = np.sqrt(2 * along / body.mass)
    length = np.sqrt(max(12 * across / body.mass - 3 * radius**2, 0.0))
    radius = float(np.clip(radius, THIN * size, THICK * size))
    return pin.SE3(_along(axes[:, 0]), body.lever), Cylinder(radius, float(length), rounded=True)


def _along(direction: Array) -> Array:
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
            far, thick = (2.0, 0.3 * THIN) if slides else (1.2 * THICK, 1.5 * THIN)
            if slides and low < high:
                low, high = np.clip([low, high], -far * size, far * size)
            else:
                low, high = -far * size, far * size
            place = pin.SE3(_along(slide + turn), (low + high) / 2 * slide)
            axle = Cylinder(thick * size, float(high - low))
            name = RAIL if slides else PIVOT
            yield Visual(name, 0, model.jointPlacements[joint] * place, axle, BEARING)


# --- additions of the scene ---------------------------------------------------------------------


def _payloads(robot: Robot) -> Iterable[Visual]:
    for i, payload in enumerate(robot.scene.payloads):
        frame = robot.frame(payload.frame)
        place = frame.placement * pin.SE3(np.eye(3), np.array(payload.com))
        radius = (3 * payload.mass / (4 * np.pi * LOAD_DENSITY)) ** (1 / 3)
        if radius > 0.0:
            yield Visual(f"payload_{i}", frame.parentJoint, place, Sphere(radius), LOAD)


def _contacts(robot: Robot) -> Iterable[Visual]:
    size, planes = robot.reach, set()
    for name, contact in robot.scene.contacts:
        joint, place = _placed(robot, contact.frame, contact.point)
        radius = contact.radius or THIN * size
        yield Visual(name, joint, place, Sphere(radius), TOUCH)
        if contact.plane not in planes:
            planes.add(contact.plane)
            joint, place = _placed(robot, contact.plane.frame, contact.plane.point)
            normal = place.rotation @ np.array(contact.plane.normal)
            wide = 0.6 * size if joint == 0 else 0.2 * size
            sheet = Box((1.6 * wide, 1.6 * wide, 2e-4 * size))
            yield Visual(
                f"{name}_plane", joint, pin.SE3(_along(normal), place.translation), sheet, SURFACE
            )


def _placed(robot: Robot, frame: str, point: Iterable[float]) -> tuple[int, pin.SE3]:
    """The joint that carries a point of a frame or of the world, and its position there."""
    offset = pin.SE3(np.eye(3), np.array(list(point)))
    found = robot.frame(frame)
    return found.parentJoint, found.placement * offset
