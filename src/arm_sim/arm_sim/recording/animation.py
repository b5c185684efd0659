# SPDX-License-Identifier: Apache-2.0
"""Films of recordings: the arm as a stick figure."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import PillowWriter

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.writing import warn_if_replaced, writing
from arm_sim.figures import COLORS, animation
from arm_sim.progress import Progress
from arm_sim.recording.motion import RecordedMotion
from arm_sim.recording.stick_figure import Points, StickFigure

_STILL = 1e-6  # relative to the motion in another direction: less is none
_ROUNDING = 1e-9  # [s], by which recorded times may be beside those that are drawn
# [Hz]; the writer cuts 1/fps down to whole milliseconds, and rounding must not cost one
_FPS_MARGIN = 1e-6
_BASE = {"color": "0.4", "marker": "^", "markersize": 9.0, "markevery": (1, 3), "label": "base"}
_RAIL = {"color": "0.6", "linewidth": 1.2, "marker": "s", "markersize": 8.0, "markevery": (1, 4),
         "markerfacecolor": COLORS[0], "label": "rail"}  # fmt: skip
_ROD = {"color": COLORS[0], "linewidth": 1.2, "marker": "", "label": "rod"}
_PLANE = {"color": "0.6", "linewidth": 1.5, "marker": "", "label": "plane of contact"}


def animate(recording: RecordedMotion, path: Path | None, rate: float, speed: float) -> Any:
    """See ``Recording.animate``."""
    if path is not None and path.suffix != ".gif":
        instead = f"animate().save('{path.name}') makes films of other formats, by ffmpeg"
        raise InvalidInput(f"'{path}': unknown format of films; allowed: .gif; {instead}")
    if not (rate > 0.0 and speed > 0.0):
        raise InvalidInput(f"rate = {rate}, speed = {speed}; allowed: more than 0")
    pace = max(round(100.0 / rate), 1) / 100.0  # [s], a GIF counts hundredths of a second
    due = np.arange(recording.time[0], recording.time[-1] + _ROUNDING, speed * pace)
    rows = np.searchsorted(recording.time, due - _ROUNDING)
    time, states = recording.time[rows], recording.q[rows]
    figure = StickFigure(recording.dynamics.model, recording.q)
    lines: list[tuple[Points, dict[str, Any]]] = [
        (figure.ground, _BASE), *((plane, _PLANE) for plane in figure.planes),
        (figure.arm, {"label": "arm"}), (figure.rods, _ROD), (figure.rails, _RAIL),
    ]  # fmt: skip
    chains = [(figure.positions(points, states), style) for points, style in lines if points]
    axes = _axes(np.hstack([points for points, style in chains if style is not _PLANE]))
    trail = figure.positions(figure.arm[-2:-1], recording.q)[:, 0]  # of the last chain's end
    film = animation(
        time, [(points[..., axes], style) for points, style in chains], speed=speed,
        frames=len(time), trail=(trail[:, axes], {"label": "path"}), trail_time=recording.time,
        axes="".join("xyz"[i] for i in axes),
    )  # fmt: skip
    if path is not None:
        _write(film, path, time, pace)
    return film


def _write(film: Any, path: Path, time: Array, pace: float) -> None:
    """Write a film of pictures at times in [s], each shown for ``pace``."""
    warn_if_replaced(path)
    with writing(path), Progress(time[-1] - time[0], "drawn") as progress:
        film.save(
            path, writer=PillowWriter(fps=1.0 / pace - _FPS_MARGIN),
            progress_callback=lambda i, _: progress.update(time[i] - time[0]),
        )  # fmt: skip


def _axes(points: Array) -> list[int]:
    """Axes of the world to draw: two if nothing moves along the third, else all.

    Args:
        points: Points of the arm over time in [m], shape (k, m, 3), with NaN.
    """
    moved = np.nanmax(np.ptp(points, axis=0), axis=0)
    extent = np.ptp(points[~np.isnan(points).any(axis=2)], axis=0)
    still = [i for i in np.argsort(extent, kind="stable") if moved[i] <= _STILL * max(moved)]
    return [i for i in range(3) if i not in still[:1]]
