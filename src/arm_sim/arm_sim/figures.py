# SPDX-License-Identifier: Apache-2.0
"""Figures and animations in a common style.

Matplotlib is imported when the first one is made.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.arrays import Array
from arm_dynamics.task_space import TaskSpace

FOLDER = Path("reports/examples")
STYLE = {
    "font.size": 10.0, "axes.titlesize": 11.0, "axes.titleweight": "bold", "axes.grid": True,
    "axes.spines.top": False, "axes.spines.right": False, "axes.axisbelow": True,
    "grid.color": "0.9", "lines.linewidth": 1.7, "legend.frameon": False, "figure.dpi": 110.0,
}  # fmt: skip
MOST_FRAMES = 60  # frames of an animation, such that a page with one stays below a megabyte
FILM_DPI = 72.0  # likewise
Chain = Array | tuple[Array, dict[str, Any]]


@contextmanager
def figure(
    name: str,
    rows: int = 1,
    columns: int = 1,
    size: tuple[float, float] | None = None,
    folder: Path = FOLDER,
    **axes: Any,
) -> Iterator[Any]:
    """A figure that is saved at the end of the ``with`` block.

    Args:
        name: Name of the file, without suffix.
        rows: Rows of axes.
        columns: Columns of axes.
        size: In inches; None for a suitable one.
        folder: Folder of the file.
        **axes: As for ``matplotlib.figure.Figure.subplots``.

    Yields:
        The axes: one, or an array of them.
    """
    path = folder / f"{name}.png"
    size = size or (4.6 * columns + 0.4, 3.1 * rows + 0.5)
    with drawn(path, rows, columns, size, squeeze=True, **axes) as found:
        yield found
    print(f"figure: {path}")


@contextmanager
def drawn(
    path: Path,
    rows: int,
    columns: int,
    size: tuple[float, float],
    squeeze: bool = False,
    **axes: Any,
) -> Iterator[Any]:
    """The same as any file, whose folder is made; an array of axes, unless they are squeezed."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        made = Figure(figsize=size, layout="constrained")
        yield made.subplots(rows, columns, squeeze=squeeze, **axes)
        path.parent.mkdir(parents=True, exist_ok=True)
        made.savefig(path)


def use_style() -> None:
    """Apply the suite's style to all further figures of pyplot."""
    import matplotlib as mpl

    mpl.rcParams.update(STYLE | {"figure.constrained_layout.use": True})


def legend_at_right(
    figure: Any,
    lines: Sequence[Any],
    labels: Sequence[str],
    loc: str = "upper right",
    **style: Any,
) -> None:
    """A legend of a whole figure, with constrained layout, to the right of its axes.

    Matplotlib itself makes room for it (``loc="outside …"``) from 3.7 on; Ubuntu 24.04 has 3.6.
    """
    legend = figure.legend(lines, labels, loc=loc, **style)
    left = legend.get_window_extent().x0 / figure.bbox.width
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, left, 1.0))


def axis_at_right(axes: Any, label: str, color: str) -> Any:
    """A second vertical axis for a curve in another unit, whose label has the curve's colour."""
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    other.grid(False)
    other.set_ylabel(label, color=color)
    return other


def animation(
    time: Array,
    chains: Sequence[Chain],
    *,
    trail: Chain | None = None,
    speed: float = 1.0,
    size: tuple[float, float] = (4.4, 4.4),
    title: str = "",
) -> Any:
    """An animated stick figure: polylines over time, in a plane with equal axes.

    Args:
        time: Of a recording in [s], shape (k,).
        chains: Polylines in [m], each of shape (k, m, 2), or (m, 2) if it does not move; or a
            pair of that and properties of Matplotlib's ``Line2D``, of which a ``label`` is shown
            below the axes. NaN is not drawn.
        trail: Points whose path is drawn up to the current time, in [m], shape (k, 2), or a pair
            likewise.
        speed: Speed of the animation relative to real time.
        size: In inches.
        title: Title of the figure.

    Returns:
        A ``matplotlib.animation.FuncAnimation`` of at most ``MOST_FRAMES`` frames; keep it as long
        as it is shown.

    Raises:
        InvalidInput: If a shape does not match ``time``, or the speed is not positive.
    """
    from matplotlib import pyplot as plt
    from matplotlib.animation import FuncAnimation

    if not speed > 0.0:
        raise InvalidInput(f"speed = {speed}; allowed: more than 0")
    time = np.asarray(time, dtype=np.float64)
    links = [_link(chain, len(time)) for chain in chains]
    path, style = trail if isinstance(trail, tuple) else (trail, {})
    path = np.full((len(time), 2), np.nan) if path is None else np.asarray(path)
    _link(path[:, None], len(time))
    shown = np.linspace(0, len(time) - 1, min(len(time), MOST_FRAMES)).round().astype(int)
    seen = [points.reshape(-1, 2) for points, _ in links] + [path]
    fig, axes = plt.subplots(figsize=size, dpi=FILM_DPI)
    axes.set(xlabel="x [m]", ylabel="z [m]", title=title)
    behind = axes.plot([], [], **{"color": "tab:orange", "linewidth": 1.2} | style)[0]
    drawn = [axes.plot([], [], **properties)[0] for _, properties in links]
    _legend_below(fig, *axes.get_legend_handles_labels())
    clock = axes.text(
        0.0, 1.01, f"{time[-1]:.2f} s", transform=axes.transAxes, verticalalignment="bottom"
    )
    fill_with(axes, np.vstack(seen))
    fig.canvas.draw()
    fig.set_layout_engine("none")  # that of this frame is that of all
    fill_with(axes, np.vstack(seen))

    def show(k: int) -> list[Any]:
        for line, (points, _) in zip(drawn, links, strict=True):
            line.set_data(*points[k].T)
        behind.set_data(*path[: k + 1].T)
        clock.set_text(f"{time[k]:.2f} s")
        return [behind, *drawn, clock]

    class Film(FuncAnimation):  # type: ignore[misc]  # Matplotlib is untyped here
        """An animation that may stay unused without a warning, as in a script without a screen."""

        def __del__(self) -> None:
            """Suppress the warning."""

    show(0)
    apart = 1e3 * (time[-1] - time[0]) / max(len(shown) - 1, 1) / speed  # [ms]
    return Film(fig, show, frames=shown.tolist(), interval=apart)


def fill_with(axes: Any, points: Array) -> None:
    """Limits around points, shape (k, 2), of one scale and such that the axes keep their size.

    NaN is ignored.
    """
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    span = high - low + 0.16 * max(high - low)
    if not span.any():
        span = np.full(2, 2.0)
    box = np.array(axes.get_window_extent().size)
    half = 0.5 * box * max(span / box)
    (left, right), (bottom, top) = np.transpose([(low + high) / 2 - half, (low + high) / 2 + half])
    axes.set(xlim=(left, right), ylim=(bottom, top))


def _legend_below(figure: Any, lines: Sequence[Any], labels: Sequence[str]) -> None:
    """A legend of a whole figure, with constrained layout, below its axes."""
    for columns in (3, 2, 1) if lines else ():
        legend = figure.legend(lines, labels, loc="lower center", ncol=columns)
        box = legend.get_window_extent()
        if box.width < figure.bbox.width or columns == 1:
            low = box.y1 / figure.bbox.height
            figure.set_layout_engine("constrained", rect=(0.0, low, 1.0, 1.0 - low))
            return
        legend.remove()


def _link(chain: Chain, count: int) -> tuple[Array, dict[str, Any]]:
    """A polyline at every time, and how it is drawn."""
    points, properties = chain if isinstance(chain, tuple) else (chain, {})
    points = np.asarray(points, dtype=np.float64)
    still = points.ndim == 2
    if points.ndim not in (2, 3) or points.shape[-1] != 2 or not (still or len(points) == count):
        raise InvalidInput(
            f"a polyline of shape {points.shape} does not match {count} times; allowed: "
            f"({count}, m, 2), or (m, 2) if it does not move"
        )
    usual = {"color": "0.6"} if still else {"color": "tab:blue", "marker": "o", "linewidth": 2.5}
    return np.broadcast_to(points, (count, *points.shape[-2:])), usual | properties


def frame_points(dynamics: Dynamics, q: Array, frames: Sequence[str], axes: str = "xz") -> Array:
    """Positions of frames of an arm, for ``animation``.

    Args:
        dynamics: Dynamics of the arm.
        q: Positions in [rad] or [m], shape (k, n).
        frames: Names of links or joints.
        axes: Two of ``xyz``: the projection of the world.

    Returns:
        Points in [m], shape (k, number of frames, 2).
    """
    spaces = [TaskSpace(dynamics, frame, selection=tuple(axes)) for frame in frames]
    kept = ["xyz".index(axis) for axis in axes]
    return np.array([[space.pose(each).position[kept] for space in spaces] for each in q])
