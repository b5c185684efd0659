# SPDX-License-Identifier: Apache-2.0
"""Draws arms with viser: links, ground, paths, and the marks of an instant."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.sampling import postures
from arm_sim.view.framing import FIELD, WAY, keep_framed
from arm_sim.view.marks import Instant, Marker, Marks
from arm_sim.view.shapes import (
    BEARING,
    LOAD,
    METAL,
    PIVOT,
    RAIL,
    SURFACE,
    TOUCH,
    Box,
    Colour,
    Cylinder,
    Mesh,
    Shape,
    Sphere,
    Visual,
    capsules_of,
    corners,
    visuals_of,
)

if TYPE_CHECKING:
    from pathlib import Path

    import viser

_log = logging.getLogger(__name__)

CONTACT, CONE, TIE, SPRING, STOP, PATH, WHOLE, MOUSE = (
    (40, 130, 60), (110, 180, 120), (140, 60, 160), (60, 120, 200), (225, 60, 40), (230, 120, 20),
    (150, 150, 150), (255, 140, 66),
)  # fmt: skip
"""Colours of contact forces, friction cones, constraint forces, springs, stops, the path, the
whole path of a recording, and the library's arrow of a drag.
"""

type Row = tuple[str, tuple[int, ...], str]
"""Of a legend: mark, colour and meaning."""

LONGEST = 0.6  # length of an arrow, relative to the reach; half of it represents the arm's weight
_POSTURES = 300  # among which the lowest point of an arm is found
KEPT = 300  # points of the path behind a moving hand
_KINDS = ("contact forces", "friction cones", "constraint forces", "springs", "path")
_NOTHING = np.zeros((1, 2, 3))


class DrawnArm:
    """One arm in the scene of a page.

    Args:
        server: The page.
        model: The arm.
        name: Name of the arm in the scene's tree.
        base: Position of its world, in [m].
        folder: Folder of meshes with relative names.

    Attributes:
        name: Name of the arm.
        base: Position of its world, shape (3,).
        marker: Computes positions.
        size: Size of the arm in [m].
        links: Drawn links and joints: names and handles.
        extent: Points around the arm at its start, and of its path, in [m], shape (k, 3).
        lowest: Height in [m] below which it has no point: at its start if it has a base to stand
            on, else wherever it turns.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        model: ArmModel,
        name: str,
        base: Sequence[float] = (0.0, 0.0, 0.0),
        folder: Path | None = None,
    ) -> None:
        self.marker, self.size = Marker(model), model.reach
        self.name, self.base = name, np.array(base, dtype=float)
        self._scene, self._name = server.scene, f"/{name}"
        self._weight = 9.81 * model.total_mass or 1.0
        self._way: list[Array] = []
        scene = self._scene
        self._root = scene.add_frame(self._name, show_axes=False, position=tuple(base))
        axes = {"axes_length": 0.12 * self.size, "axes_radius": 0.004 * self.size}
        joints = ["base", *list(model.pin.names)[1:]]
        self._joints = [
            scene.add_frame(f"{self._name}/{joint}", show_axes=False, **axes) for joint in joints
        ]
        visuals = visuals_of(model, folder)
        self.links = self._draw_all(visuals, joints)
        carried = [(x.joint, corners(x)) for x in visuals if x.joint or x.name == PIVOT]
        self.extent = self.base + self.marker.extent(model.q0, carried)
        self.lowest = float(self.marker.at(Instant(0.0, model.q0)).position[:, 2].min())
        self._hangs = any(visual.name in (PIVOT, RAIL) for visual in visuals)
        if self._hangs:
            moving = (self.marker.extent(q, carried) for q in postures(model, _POSTURES))
            lowest = min(float(points[:, 2].min()) for points in moving)
            self.lowest = min(self.lowest, max(lowest, -2 * self.size))  # rails may go on for ever
        self._arrows, self._lines = self._hidden_arrows(), self._hidden_lines()
        self._stops = [
            scene.add_icosphere(
                f"{self._name}/stop {i}", 0.055 * self.size, color=STOP, opacity=0.6, visible=False
            )
            for i in range(model.n)
        ]
        self._shown = dict.fromkeys(_KINDS, True)

    def draw(self, instant: Instant) -> Marks:
        """Draw an instant; the caller groups changes that appear together."""
        marks = self.marker.at(instant)
        for frame, position, wxyz in zip(
            self._joints, marks.position, marks.rotation, strict=True
        ):
            frame.position, frame.wxyz = position, wxyz
        for kind, forces in (
            ("contact forces", marks.contacts), ("constraint forces", marks.constraints)
        ):  # fmt: skip
            self._set(self._arrows[kind], self._to_arrows(forces), self._shown[kind])
        self._draw_cones(marks.contacts, instant.cones)
        self._set(self._lines["springs"], _coils(marks.springs, self.size), self._shown["springs"])
        for i, ball in enumerate(self._stops):
            ball.visible = i < len(marks.stops)
            if ball.visible:
                ball.position = marks.stops[i]
        return marks

    def _draw_cones(self, contacts: Array, normals: Array) -> None:
        known = normals[self._seen(contacts)] if len(normals) else normals
        outlines = _cones(self._to_arrows(contacts), known)
        self._set(self._lines["friction cones"], outlines, self._shown["friction cones"])

    def trail(self, hand: Array) -> None:
        """Extend the hand's path to a position, shape (3,)."""
        if self._way and float(np.linalg.norm(hand - self._way[-1])) < 2e-3 * self.size:
            return
        self._way = [*self._way[-KEPT:], hand]
        self._set(self._lines["path"], _pairs(np.array(self._way)), self._shown["path"])

    def forget_way(self) -> None:
        """Restart the hand's path."""
        self._way = []
        self._lines["path"].visible = False

    def show_path(self, path: Array) -> None:
        """Draw a complete, permanent path of the hand, shape (k, 3), which extends the arm."""
        self.extent = np.vstack([self.extent, self.base + path])
        self._set(self._lines["whole path"], _pairs(path), self._shown["path"])

    def legend(self) -> Iterator[Row]:
        """What its marks are, as far as it can have them."""
        model = self.marker.model
        scene, springs, stops = model.scene, model.springs.points, model.stops.limit
        whole = self._lines["whole path"].visible
        for drawn, mark, colour, text in (
            (self._hangs, "●", _bytes(BEARING), "pivot or rail, fixed to the world"),
            (scene.payloads, "●", _bytes(LOAD), "payload"),
            (scene.contacts, "●", _bytes(TOUCH), "point of contact"),
            (scene.contacts, "■", _bytes(SURFACE), "plane of contact"),
            (scene.contacts, "➔", CONTACT, "force of the contact on the arm"),
            (scene.contacts, "▽", CONE, "friction cone: inside, the contact sticks"),
            (scene.bilateral, "➔", TIE, "force of a constraint"),
            (springs, "≈", SPRING, "spring"),
            (np.isfinite(stops).any(), "●", STOP, "joint at its end stop"),
            (True, "━", PATH, "path of the hand"),
            (whole, "━", WHOLE, "whole path of the hand"),
        ):
            if drawn:
                yield mark, colour, text

    def show_axes(self, on: bool) -> None:
        """Show or hide the axes of the joints' frames."""
        for joint in self._joints:
            joint.show_axes = on

    def show_links(self, on: bool) -> None:
        """Show or hide the links."""
        for _, link in self.links:
            link.visible = on

    def show(self, kind: str, on: bool) -> None:
        """Show or hide one of ``_KINDS``."""
        self._shown[kind] = on
        for handle in (
            [self._lines["path"], self._lines["whole path"]] if kind == "path"
            else [(self._arrows | self._lines)[kind]]
        ):  # fmt: skip
            handle.visible = on and bool(np.ptp(handle.points))

    def _to_arrows(self, forces: Array) -> Array:
        """Arrows of points and forces: start and end points, with long forces shortened."""
        forces = forces[self._seen(forces)]
        way = forces[:, 1] * (LONGEST * self.size / (_sizes(forces) + self._weight))[:, None]
        return np.stack([forces[:, 0], forces[:, 0] + way], axis=1)

    def _seen(self, forces: Array) -> Array:
        """Which of points and forces have an arrow that is long enough to be seen, shape (k,)."""
        size = _sizes(forces)
        return np.asarray(LONGEST * size > 2e-3 * (size + self._weight))

    @staticmethod
    def _set(handle: Any, points: Array, on: bool) -> None:
        if len(points):
            handle.points = points
        handle.visible = on and len(points) > 0

    def _hidden_arrows(self) -> dict[str, Any]:
        """Arrows of forces by kind."""
        thin = {"shaft_radius": 0.006 * self.size, "head_radius": 0.016 * self.size,
                "head_length": 0.04 * self.size}  # fmt: skip
        return {
            kind: self._scene.add_arrows(
                f"{self._name}/{kind}", _NOTHING, colour, visible=False, **thin
            )
            for kind, colour in {"contact forces": CONTACT, "constraint forces": TIE}.items()
        }

    def _hidden_lines(self) -> dict[str, Any]:
        """Lines by kind."""
        return {
            kind: self._scene.add_line_segments(
                f"{self._name}/{kind}", _NOTHING, colour, thickness=width, visible=False,
                thickness_units="screen",
            )
            for kind, colour, width in (
                ("springs", SPRING, 4.0), ("friction cones", CONE, 1.5), ("path", PATH, 2.5),
                ("whole path", WHOLE, 1.5),
            )
        }  # fmt: skip

    def _draw_all(self, visuals: Sequence[Visual], joints: Sequence[str]) -> list[tuple[str, Any]]:
        handles, broken = [], set[int]()
        for i, visual in enumerate(visuals):
            try:
                handle = self._draw_one(visual, f"{joints[visual.joint]}/{i} {visual.name}")
                handles.append((visual.name, handle))
            except Exception as error:  # any error of a mesh parser
                _log.warning(
                    "link '%s' is drawn without its mesh %s: %s: %s", visual.name,
                    getattr(visual.shape, "path", ""), type(error).__name__, error,
                )  # fmt: skip
                broken.add(visual.joint)
        for i, visual in enumerate(capsules_of(self.marker.model, broken - {0})):
            handle = self._draw_one(visual, f"{joints[visual.joint]}/in place of a mesh {i}")
            handles.append((visual.name, handle))
        return handles

    def _draw_one(self, visual: Visual, name: str) -> Any:
        wxyz = np.roll(pin.Quaternion(visual.placement.rotation).coeffs(), 1)
        place = {"wxyz": wxyz, "position": visual.placement.translation}
        where, colour = f"{self._name}/{name}", visual.colour
        if isinstance(visual.shape, Mesh):
            return self._scene.add_glb(where, _glb(visual.shape, colour), **place)
        mesh, (r, g, b, a) = _solid(visual.shape), colour or METAL
        return self._scene.add_mesh_simple(
            where, mesh.vertices, mesh.faces, color=(r, g, b), opacity=a if a < 1.0 else None,
            flat_shading=isinstance(visual.shape, Box), **place,
        )  # fmt: skip


def lay_ground(server: viser.ViserServer, actors: Sequence[DrawnArm], width: float) -> None:
    """A grid, light and a camera for the arms, which occupy a ``width`` in [m]."""
    size = max(actor.size for actor in actors)
    lowest = min(actor.lowest for actor in actors)
    level = min(lowest, 0.0) - (0.15 * size if lowest < -1e-3 else 0.0)
    extent = 2.0 * (width + 2.0 * size)
    server.scene.add_grid(
        "/ground", extent, extent, cell_size=0.1 * _round(size), section_size=_round(size),
        position=(0.0, 0.0, level), fade_distance=4.0 * extent, shadow_opacity=0.25,
    )  # fmt: skip
    server.scene.set_background_image(_sky(), format="png")
    places = np.concatenate([actor.extent for actor in actors])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    radius = float(np.linalg.norm(places - middle, axis=1).max())
    whole = radius / np.sin(FIELD / 2) / np.linalg.norm(WAY)
    server.initial_camera.look_at = middle
    server.initial_camera.position = middle + WAY * max(1.05 * size + 0.8 * width, whole)
    server.initial_camera.fov = FIELD
    keep_framed(server, places)


def _sky() -> Any:
    """A pale blue gradient, against which white arms are visible, as bytes, (64, 4, 3)."""
    top, bottom = np.array([196.0, 212.0, 230.0]), np.array([250.0, 250.0, 252.0])
    column = top + np.linspace(0.0, 1.0, 64)[:, None] * (bottom - top)
    return np.repeat(column[:, None], 4, axis=1).astype(np.uint8)


def legend(rows: Iterable[Row]) -> str:
    """A legend as HTML."""
    cells = "".join(
        f'<span style="color:rgb{colour}">{mark}</span><span>{text}</span>'
        for mark, colour, text in rows
    )
    grid = "display:grid;grid-template-columns:1.2em 1fr;gap:0 0.4em"
    return f'<div style="{grid};font-size:0.8em;padding:0.3em 1em">{cells}</div>'


def _bytes(colour: Colour) -> tuple[int, ...]:
    return tuple(round(255 * x) for x in colour[:3])


def _round(size: float) -> float:
    """The power of ten next to a length."""
    return float(10.0 ** np.round(np.log10(size)))


def _pairs(points: Array) -> Array:
    """Segments between points of shape (k, 3), shape (k - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def _sizes(forces: Array) -> Array:
    """Magnitudes of forces, shape (k, 2, 3), the second of each pair."""
    return np.asarray(np.linalg.norm(forces[:, 1], axis=1))


def _cones(arrows: Array, normals: Array, sides: int = 24) -> Array:
    """Outlines of friction cones, as high as the normal parts of arrows, shape (k, 2, 3).

    Args:
        arrows: Start and end points of arrows of forces, shape (k, 2, 3).
        normals: Normals, each as long as its coefficient of friction, shape (k, 3), or (0, 3).
        sides: Sides of the rim.
    """
    lines, turn = [np.zeros((0, 2, 3))], np.linspace(0.0, 2.0 * np.pi, sides + 1)[:, None]
    for (tip, end), slope in zip(arrows, normals, strict=False):
        friction = float(np.linalg.norm(slope))
        if friction == 0.0:
            continue
        normal = slope / friction
        height = float((end - tip) @ normal)
        first = np.cross(normal, np.eye(3)[np.argmin(abs(normal))])
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        rim = np.cos(turn) * first + np.sin(turn) * second
        rim = tip + height * (normal + friction * rim)
        edges = rim[:: sides // 4][:4]
        lines += [_pairs(rim), np.stack([np.broadcast_to(tip, edges.shape), edges], axis=1)]
    return np.concatenate(lines)


def _coils(springs: Array, size: float, turns: int = 9) -> Array:
    """Zigzag lines between the ends of springs, shape (s, 2, 3), as segments."""
    lines = []
    for first, second in springs:
        way = second - first
        side = np.cross(way, [0.3, -0.8, 0.5] if abs(way[0]) > abs(way[1]) else [1.0, 0.0, 0.2])
        side *= 0.02 * size / max(float(np.linalg.norm(side)), 1e-12)
        inner = np.linspace(0.1, 0.9, 2 * turns)[:, None]
        bent = first + inner * way + side * np.resize([1.0, -1.0], (2 * turns, 1))
        lines.append(_pairs(np.vstack([first, bent, second])))
    return np.concatenate(lines) if lines else np.zeros((0, 2, 3))


@lru_cache(maxsize=256)
def _glb(mesh: Mesh, colour: Colour | None) -> bytes:
    """A mesh file as binary glTF, in [m]; a colour applies to files that have none."""
    import trimesh

    loaded = trimesh.load_scene(mesh.path)
    if not loaded.geometry:
        raise ValueError("it holds no triangles")
    unit, _, of = str(loaded.units or "").partition(" * ")
    scale = np.array(mesh.scale) * (float(unit) if of == "meters" else 1.0)
    if not np.all(scale == 1.0):
        loaded.apply_transform(np.diag([*scale, 1.0]))
    if mesh.path.suffix.lower() in (".stl", ".ply"):
        a = round(255 * (colour or METAL)[3])
        for geometry in loaded.geometry.values():
            geometry.visual = trimesh.visual.TextureVisuals(
                material=trimesh.visual.material.PBRMaterial(
                    baseColorFactor=[*_bytes(colour or METAL), a],
                    metallicFactor=0.1,
                    roughnessFactor=0.6,
                )
            )
    return bytes(loaded.export(file_type="glb"))


@lru_cache(maxsize=256)
def _solid(shape: Shape) -> Any:
    import trimesh.creation as make

    if isinstance(shape, Box):
        return make.box(shape.size)
    if isinstance(shape, Sphere):
        return make.icosphere(subdivisions=3, radius=shape.radius)
    assert isinstance(shape, Cylinder)
    if not shape.rounded:
        return make.cylinder(shape.radius, shape.length)
    height = max(shape.length - 2 * shape.radius, 1e-6)
    capsule = make.capsule(height, shape.radius)
    capsule.apply_translation([0.0, 0.0, -capsule.bounds.mean(axis=0)[2]])
    return capsule
