# SPDX-License-Identifier: Apache-2.0
"""Films of recordings: the arm as a stick figure."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.animation import PillowWriter

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.writing import warn_if_replaced
from arm_sim.figures import animation
from arm_sim.progress import Progress
from arm_sim.recording.files.writer import check_folder
from arm_sim.recording.motion import RecordedMotion


def animate(recording: RecordedMotion, path: Path | None, rate: float, speed: float) -> Any:
    """See ``Recording.animate``."""
    if path is not None:
        check_folder(path)
        if path.suffix != ".gif":
            instead = f"animate().save('{path.name}') makes films of other formats, by ffmpeg"
            raise InvalidInput(f"'{path}': unknown format of films; allowed: .gif; {instead}")
    if not (rate > 0.0 and speed > 0.0):
        raise InvalidInput(f"rate = {rate}, speed = {speed}; allowed: more than 0")
    pace = max(round(100.0 / rate), 1) / 100.0  # [s], a GIF counts hundredths of a second
    time = np.arange(recording.time[0], recording.time[-1] + 1e-9, speed * pace)
    states = recording.q[np.searchsorted(recording.time, time - 1e-9)]
    shapes = [_shapes(recording.dynamics.model, q) for q in states]
    ground, arm, surfaces = map(np.array, zip(*shapes, strict=True))
    points = np.hstack([ground, arm])
    low, high = np.nanmin(points, axis=(0, 1)), np.nanmax(points, axis=(0, 1))
    plane = np.sort(np.argsort(high - low, kind="stable")[1:])
    middle, half = (low + high)[plane] / 2, 0.6 * max(high - low)
    edges = [_edge(surfaces[:, i][..., plane], middle, half) for i in range(surfaces.shape[1])]
    base = {"color": "0.4", "marker": "^", "markersize": 9.0, "markevery": (1, 4), "label": "base"}
    film = animation(
        time,
        [(ground[..., plane], base),
         *((edge, {"color": "0.6", "marker": "", "label": "plane of contact"}) for edge in edges),
         (arm[..., plane], {"label": "arm"})],
        speed=speed, frames=len(time),
        trail=(arm[:, -2, plane], {"label": "path"}), axes="".join("xyz"[i] for i in plane),
    )  # fmt: skip
    if path is not None:
        warn_if_replaced(path)
        with Progress(time[-1] - time[0], "drawn") as progress:
            film.save(
                path, writer=PillowWriter(fps=1.0 / pace - 1e-6),
                progress_callback=lambda i, _: progress.update(time[i] - time[0]),
            )  # fmt: skip
    return film


def _shapes(model: ArmModel, q: Array) -> tuple[list[Array], list[Array], list[Array]]:
    """Polylines of the ground and of the arm, and a point and the normal of each plane.

    For each joint its way from the one before, and to the end of a last body; then NaN.
    """
    tree, data, gap = model.pin, model.pin.createData(), np.full(3, np.nan)
    pin.forwardKinematics(tree, data, model.configuration(q))
    ground, arm = list[Array](), list[Array]()
    for joint in range(1, tree.njoints):
        here, parent = data.oMi[joint], tree.parents[joint]
        way = [here.translation, gap]
        if parent:
            arm += [data.oMi[parent].translation, *way]
        else:
            ground += [data.oMi[0].translation, tree.jointPlacements[joint].translation, *way]
        if joint not in tree.parents:
            arm += [here.translation, here.act(_end(model, joint)), gap]
    surfaces = []
    for surface in dict.fromkeys(contact.plane for _, contact in model.scene.contacts):
        frame = model.frame(surface.frame)
        place, normal = data.oMi[frame.parentJoint] * frame.placement, np.array(surface.normal)
        across = place.rotation @ normal / np.linalg.norm(normal)
        surfaces.append(np.array([place.act(np.array(surface.point)), across]))
    return ground, arm, surfaces


def _edge(surface: Array, middle: Array, half: float) -> Array:
    """A plane, seen from its edge; NaN where it is seen otherwise."""
    point, (x, z) = surface[:, 0], surface[:, 1].T
    along = np.where(np.hypot(x, z) > 0.99, (-z, x), np.nan).T
    near = point + along * ((middle - point) * along).sum(axis=1, keepdims=True)
    return np.stack([near - half * along, near + half * along], axis=1)


def _end(model: ArmModel, joint: int) -> Array:
    """The point of a last body farthest from its joint: of a frame, a loop or its mass."""
    points = [model.pin.inertias[joint].lever]
    ends = [(frame.name, np.zeros(3)) for frame in model.pin.frames[1:]]
    for loop in model.scene.constraints:
        ends += zip(getattr(loop, "frames", ()), getattr(loop, "points", ()), strict=False)
    for name, point in ends:
        frame = model.pin.frames[model.pin.getFrameId(name)]
        if frame.parentJoint == joint:
            points.append(frame.placement.act(np.array(point)))
    return max(points, key=np.linalg.norm)
