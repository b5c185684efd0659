# SPDX-License-Identifier: Apache-2.0
"""Draws arms with viser: links, ground, paths, and the marks of an instant."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel, postures
from arm_sim.view import shapes
from arm_sim.view.framing import direction, keep_framed
from arm_sim.view.marks import ArmMarks, Instant, Marker

if TYPE_CHECKING:
    from pathlib import Path

    import viser

_log = logging.getLogger(__name__)

# Colours of contact forces, friction cones, constraint forces, springs, stops, the path, the whole
# path of a recording, and the library's arrow of a drag.
CONTACT, CONE, TIE, SPRING, STOP, PATH, WHOLE, MOUSE = (
    (40, 130, 60), (110, 180, 120), (140, 60, 160), (60, 120, 200), (225, 60, 40), (230, 120, 20),
    (150, 150, 150), (255, 140, 66),
)  # fmt: skip

# Of a legend: mark, colour and meaning
type Row = tuple[str, tuple[int, ...], str]

MAX_LENGTH = 0.6  # of an arrow, relative to the reach; half of it represents the arm's weight
MIN_LENGTH = 0.1  # of an arrow, relative to the reach
MIN_FORCE = 3e-3  # that has an arrow, relative to the arm's weight
PATH_POINTS = 300  # points of the path behind the end effector
_POSTURES = 300  # among which the lowest point of an arm is found
_FRAMED_POSTURES = 100  # postures of a recording that its picture is fitted to
_TURN = np.linspace(0.0, 2.0 * np.pi, 25)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN), 0.0 * _TURN])


@dataclass
class _Mark:
    """Arrows or lines of one kind, which are visible unless hidden by a visitor, or empty."""

    handle: Any
    hidden: bool = False
    empty: bool = True

    def set(self, points: Array) -> None:
        self.empty = not len(points)
        if not self.empty:
            self.handle.points = points
        self.show(not self.hidden)

    def show(self, on: bool) -> None:
        self.hidden = not on
        self.handle.visible = not (self.hidden or self.empty)


class DrawnArm:
    """One arm in the scene of a page.

    Attributes:
        base: Position of its world in [m], shape (3,).
        links: Names and handles of links, and of joints that are drawn in their place.
        extent: Points around the arm in [m], shape (k, 3): during a recording, else at its start,
            or wherever it swings if it has no base.
        axes: Those of its joints that turn, at its start, shape (3, k).
        lowest: Height in [m] below which it has no point: at its start if it has a base to stand
            on, else wherever it turns.
    """

    def __init__(
        self, server: viser.ViserServer, model: ArmModel, name: str,
        base: Sequence[float] = (0.0, 0.0, 0.0), folder: Path | None = None,
    ) -> None:  # fmt: skip
        self.marker, self.size = Marker(model), model.reach
        self.name, self.base = name, np.array(base, dtype=float)
        self._scene, self._name = server.scene, f"/{name}"
        self._weight = 9.81 * model.total_mass or 1.0
        self._path = list[Array]()
        self._scene.add_frame(self._name, show_axes=False, position=tuple(base))
        axes = {"axes_length": 0.12 * self.size, "axes_radius": 0.004 * self.size}
        self._joints = {
            joint: self._scene.add_frame(f"{self._name}/{joint}", show_axes=False, **axes)
            for joint in ("base", *list(model.pin.names)[1:])
        }
        visuals = shapes.visuals_of(model, folder)
        self.links = self._draw_all(visuals)
        self._marks = self._empty_marks()
        self._stops = [
            self._scene.add_icosphere(
                f"{self._name}/{joint}/stop", 0.055 * self.size, color=STOP, opacity=0.6,
                visible=False,
            )
            for joint in model.joint_names
        ]  # fmt: skip
        self._carried = [
            (x.joint, x.corners) for x in visuals if x.joint or x.name == shapes.PIVOT
        ]
        self.extent = self._extent([model.q0])
        jacobian = model.pin, model.pin.createData(), model.configuration(model.q0)
        self.axes = pin.computeJointJacobians(*jacobian)[3:]
        self.lowest = float(self.marker.at(Instant(model.q0)).position[:, 2].min())
        self._has_pivots = any(visual.name in (shapes.PIVOT, shapes.RAIL) for visual in visuals)
        if self._has_pivots:
            swing = self._extent(postures(model, _POSTURES)) - self.base
            reached = self.base + np.clip(swing, -self.size, self.size)  # rails go on for ever
            self.extent = np.vstack([self.extent, reached])
            self.lowest = min(self.lowest, max(float(swing[:, 2].min()), -2 * self.size))

    def draw(self, instant: Instant, leave_path: bool = False) -> ArmMarks:
        """Draw an instant; the caller groups changes that appear together."""
        marks = self.marker.at(instant)
        joints = zip(self._joints.values(), marks.position, marks.rotation, strict=True)
        for frame, position, wxyz in joints:
            frame.position, frame.wxyz = position, wxyz
        contacts = self._visible(instant.contacts)
        arrows = self._arrows(contacts)
        self._marks["contact forces"].set(arrows)
        self._marks["friction cones"].set(_cones(arrows, contacts[:, 2]))
        self._marks["constraint forces"].set(self._arrows(self._visible(marks.constraints)))
        self._marks["springs"].set(_coils(marks.springs, self.size))
        for ball, at_stop in zip(self._stops, marks.at_stop, strict=True):
            ball.visible = bool(at_stop)
        way = np.linalg.norm(marks.hand - self._path[-1]) if self._path else np.inf
        if leave_path and way > 2e-3 * self.size:
            self._path = [*self._path[-PATH_POINTS:], marks.hand]
            self._marks["path"].set(_pairs(np.array(self._path)))
        return marks

    def clear_path(self) -> None:
        """Restart the path of the end effector."""
        self._path = []
        self._marks["path"].set(_pairs(np.zeros((0, 3))))

    def show_path(self, q: Array) -> None:
        """Draw the path of the end effector of a recording with these positions, shape (k, n)."""
        self.extent = self._extent(q[:: -(-len(q) // _FRAMED_POSTURES)])
        self._marks["whole path"].set(_pairs(self.marker.path(q)))

    def legend(self) -> Iterator[Row]:
        """What its marks are, as far as it can have them."""
        model = self.marker.model
        scene, springs, stops = model.scene, model.springs.points, model.stops.limit
        whole_path = not self._marks["whole path"].empty
        for exists, mark, colour, text in (
            (self._has_pivots, "●", _bytes(shapes.BEARING), "pivot or rail"),
            (scene.payloads, "●", _bytes(shapes.LOAD), "payload"),
            (scene.contacts, "●", _bytes(shapes.TOUCH), "point of contact"),
            (scene.contacts, "■", _bytes(shapes.SURFACE), "plane of contact"),
            (scene.contacts, "➔", CONTACT, "force of the contact on the arm"),
            (scene.contacts, "▽", CONE, "friction cone: inside, the contact sticks"),
            (scene.bilateral, "➔", TIE, "force of a constraint"),
            (springs, "≈", SPRING, "spring"),
            (np.isfinite(stops).any(), "●", STOP, "joint at its end stop"),
            (True, "━", PATH, "path of the end effector"),
            (whole_path, "━", WHOLE, "whole path of the end effector"),
        ):
            if exists:
                yield mark, colour, text

    def show(self, kind: str, on: bool) -> None:
        """Show or hide ``links``, ``axes``, or marks of a kind."""
        if kind == "links":
            for _, link in self.links:
                link.visible = on
        elif kind == "axes":
            for joint in self._joints.values():
                joint.show_axes = on
        else:
            for name, mark in self._marks.items():
                if name.endswith(kind):  # both paths are of one kind
                    mark.show(on)

    def _extent(self, postures: Iterable[Array]) -> Array:
        """Points around the arm in postures in [m], shape (k, 3)."""
        points = [self.marker.extent(q, self._carried) for q in postures]
        return self.base + np.concatenate(points)

    def _visible(self, forces: Array) -> Array:
        """Forces that have an arrow."""
        size = np.linalg.norm(forces[:, 1], axis=1)
        return np.asarray(forces[size > MIN_FORCE * self._weight])

    def _arrows(self, forces: Array) -> Array:
        """Arrows of points and forces: start and end points; none is very long or short."""
        size = np.linalg.norm(forces[:, 1], axis=1)
        length = self.size * np.maximum(MAX_LENGTH * size / (size + self._weight), MIN_LENGTH)
        way = forces[:, 1] * (length / size)[:, None]
        return np.stack([forces[:, 0], forces[:, 0] + way], axis=1)

    def _empty_marks(self) -> dict[str, _Mark]:
        """Arrows and lines of marks, by kind."""
        nothing, size = np.zeros((1, 2, 3)), self.size
        arrow = {
            "shaft_radius": 0.006 * size, "head_radius": 0.016 * size, "head_length": 0.04 * size
        }  # fmt: skip
        marks = dict[str, _Mark]()
        for kind, colour in (("contact forces", CONTACT), ("constraint forces", TIE)):
            name = f"{self._name}/{kind}"
            arrows = self._scene.add_arrows(name, nothing, colour, visible=False, **arrow)
            marks[kind] = _Mark(arrows)
        for kind, colour, width in (
            ("springs", SPRING, 4.0), ("friction cones", CONE, 1.5), ("path", PATH, 2.5),
            ("whole path", WHOLE, 1.5),
        ):  # fmt: skip
            name, in_pixels = f"{self._name}/{kind}", {"thickness_units": "screen"}
            lines = self._scene.add_line_segments(
                name, nothing, colour, thickness=width, visible=False, **in_pixels
            )
            marks[kind] = _Mark(lines)
        return marks

    def _draw_all(self, visuals: Iterable[shapes.Visual]) -> list[tuple[str, Any]]:
        """Draw visuals; links whose mesh cannot be read are drawn as capsules."""
        handles, broken = list[tuple[str, Any]](), set[int]()
        for visual in visuals:
            try:
                handles.append((visual.name, self._draw_one(visual, len(handles))))
            except Exception as error:  # any error of a mesh parser
                _log.warning(
                    "link '%s' is drawn without its mesh %s: %s: %s", visual.name, visual.path,
                    type(error).__name__, error,
                )  # fmt: skip
                broken.add(visual.joint)
        for visual in shapes.capsules_of(self.marker.model, broken - {0}):
            handles.append((visual.name, self._draw_one(visual, len(handles))))
        return handles

    def _draw_one(self, visual: shapes.Visual, number: int) -> Any:
        """Draw a visual in the frame of its joint; returns its handle."""
        joint = [*self._joints][visual.joint]
        name, kind = f"{self._name}/{joint}/{number} {visual.name}", visual.kind
        wxyz = np.roll(pin.Quaternion(visual.placement.rotation).coeffs(), 1)
        place = {"wxyz": wxyz, "position": visual.placement.translation}
        if visual.path is not None:
            data, scale = _glb(visual)
            return self._scene.add_glb(name, data, scale=scale, **place)
        size, colour = visual.size, visual.colour or shapes.METAL
        wide, opacity = size[0], colour[3]
        clear = {"opacity": opacity, "cast_shadow": False} if opacity < 1.0 else {}
        look = {"color": _bytes(colour), **clear}
        if kind == "box":
            return self._scene.add_box(name, dimensions=size, **look, **place)
        if kind == "cylinder":
            return self._scene.add_cylinder(name, wide / 2, size[2], **look, **place)
        if kind == "sphere":
            return self._scene.add_icosphere(name, wide / 2, **look, **place)
        from trimesh.creation import capsule

        mesh = capsule(max(size[2] - wide, 1e-6), wide / 2)
        mesh.apply_translation([0.0, 0.0, -mesh.bounds.mean(axis=0)[2]])
        return self._scene.add_mesh_simple(name, mesh.vertices, mesh.faces, **look, **place)


def lay_ground(server: viser.ViserServer, actors: Sequence[DrawnArm], width: float) -> None:
    """A grid, light and a camera for the arms, which occupy a ``width`` in [m]."""
    size = max(actor.size for actor in actors)
    lowest = min(actor.lowest for actor in actors)
    level = min(lowest, 0.0) - (0.15 * size if lowest < -1e-3 else 0.0)
    extent, section = 6.0 * (width + 2.0 * size), float(10.0 ** np.round(np.log10(size)))
    server.scene.add_grid(
        "/ground", extent, extent, cell_size=0.1 * section, section_size=section,
        position=(0.0, 0.0, level), fade_distance=0.8 * extent, shadow_opacity=0.25,
    )  # fmt: skip
    # A sky and a ground against which white arms and dark ones are visible.
    column = np.linspace([205.0, 218.0, 232.0], [178.0, 191.0, 205.0], 64, dtype=np.uint8)
    server.scene.set_background_image(np.repeat(column[:, None], 4, axis=1), format="png")
    keep_framed(server, *around(actors))


def around(actors: Sequence[DrawnArm]) -> tuple[Array, float, Array]:
    """Points around arms, shape (k, 3), the least distance of a camera in [m], and where it is."""
    points = np.concatenate([x.extent for x in actors])
    from_arms = direction(np.hstack([x.axes for x in actors]), points)
    return points, max(x.size for x in actors), from_arms


def legend(rows: Iterable[Row]) -> str:
    """A legend as HTML."""
    cells = "".join(
        f'<span style="color:rgb{colour}">{mark}</span><span>{text}</span>'
        for mark, colour, text in rows
    )
    grid = "display:grid;grid-template-columns:1.2em 1fr;gap:0 0.4em"
    return f'<div style="{grid};font-size:0.8em;padding:0.3em 1em">{cells}</div>'


def _bytes(colour: shapes.Colour) -> tuple[int, ...]:
    return tuple(round(255 * x) for x in colour[:3])


def _pairs(points: Array) -> Array:
    """Segments between points of shape (k, 3), shape (k - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def _cones(arrows: Array, normals: Array) -> Array:
    """Outlines of friction cones, as high as the normal parts of arrows, shape (k, 2, 3).

    Each of the normals, shape (k, 3), is as long as its coefficient of friction.
    """
    lines = [np.zeros((0, 2, 3))]
    for (tip, end), slope in zip(arrows, normals, strict=True):
        if friction := float(np.linalg.norm(slope)):
            height = (end - tip) @ slope / friction
            rim = tip + height * (friction * _CIRCLE + [0.0, 0.0, 1.0]) @ shapes.turn_to(slope).T
            edges = rim[:-1:6]
            lines += [_pairs(rim), np.stack([np.broadcast_to(tip, edges.shape), edges], axis=1)]
    return np.concatenate(lines)


def _coils(springs: Array, size: float, turns: int = 9) -> Array:
    """Zigzag lines between the ends of springs, shape (s, 2, 3), as segments."""
    lines = [np.zeros((0, 2, 3))]
    for first, second in springs:
        way = second - first
        side = np.cross(way, [0.3, -0.8, 0.5] if abs(way[0]) > abs(way[1]) else [1.0, 0.0, 0.2])
        side *= 0.02 * size / max(float(np.linalg.norm(side)), 1e-12)
        inner = np.linspace(0.1, 0.9, 2 * turns)[:, None]
        bent = first + inner * way + side * np.resize([1.0, -1.0], (2 * turns, 1))
        lines.append(_pairs(np.vstack([first, bent, second])))
    return np.concatenate(lines)


def _glb(visual: shapes.Visual) -> tuple[bytes, tuple[float, ...]]:
    """A mesh file as binary glTF, and its scale to [m]; a colour is for files without one."""
    import trimesh

    assert visual.path is not None
    loaded = trimesh.load_scene(visual.path)
    if not loaded.geometry:
        raise ValueError("it holds no triangles")
    unit, _, of = str(loaded.units or "").partition(" * ")
    scale = np.array(visual.size) * (float(unit) if of == "meters" else 1.0)
    if visual.path.suffix.lower() in (".stl", ".ply"):
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=[round(255 * x) for x in visual.colour or shapes.METAL],
            metallicFactor=0.1, roughnessFactor=0.6,
        )  # fmt: skip
        for geometry in loaded.geometry.values():
            geometry.visual = trimesh.visual.TextureVisuals(material=material)
    return bytes(loaded.export(file_type="glb")), tuple(scale.tolist())
