# SPDX-License-Identifier: Apache-2.0
"""Films of recordings: the arm as a stick figure."""

from __future__ import annotations

from collections.abc import Iterator
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
from arm_sim.recording.motion import RecordedMotion


def animate(recording: RecordedMotion, path: Path | None, rate: float, speed: float) -> Any:
    """See ``Recording.animate``."""
    if path is not None and path.suffix != ".gif":
        raise InvalidInput(f"'{path}': unknown format of films; allowed: .gif")
    if not (rate > 0.0 and speed > 0.0):
        raise InvalidInput(f"rate = {rate}, speed = {speed}; allowed: more than 0")
    pace = max(round(100.0 / rate), 1) / 100.0  # [s], a GIF counts hundredths of a second
    time = np.arange(recording.time[0], recording.time[-1] + 1e-9, speed * pace)
    states = recording.q[np.searchsorted(recording.time, time - 1e-9)]
    points = np.array([list(_sticks(recording.dynamics.model, q)) for q in states])
    spread = np.nanmax(points, axis=(0, 1)) - np.nanmin(points, axis=(0, 1))
    plane = np.sort(np.argsort(spread, kind="stable")[1:])
    film = animation(
        time, [(points[..., plane], {"label": "arm"})], speed=speed, frames=len(time),
        trail=(points[:, -2, plane], {"label": "path"}), axes="".join("xyz"[i] for i in plane),
    )  # fmt: skip
    if path is not None:
        warn_if_replaced(path)
        film.save(path, writer=PillowWriter(fps=1.0 / pace - 1e-6))
    return film


def _sticks(model: ArmModel, q: Array) -> Iterator[Array]:
    """For each joint its way from the one before, and to the end of a last body; then NaN."""
    tree, data = model.pin, model.pin.createData()
    pin.forwardKinematics(tree, data, model.configuration(q))
    for joint in range(1, tree.njoints):
        here = data.oMi[joint]
        yield from (data.oMi[tree.parents[joint]].translation, here.translation)
        if joint not in tree.parents:
            yield here.act(_end(model, joint))
        yield np.full(3, np.nan)


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
