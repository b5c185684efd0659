# SPDX-License-Identifier: Apache-2.0
"""Figures and animations in the house style, by which every picture of the suite is drawn.

Text has at least 8 points where a page shows a figure, at most seven colours are used, which are
told apart without seeing colours, and a figure has one legend. Matplotlib is imported when the
first one is made.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from os.path import commonprefix
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array

FOLDER = Path("reports/examples")
WIDTH = 7.2  # [in], of the text of a page; wider figures are shrunk, and their letters with them
COLORS = (  # Okabe and Ito, Color Universal Design, without yellow
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000",
)  # fmt: skip
STYLE = {
    "font.size": 9.0, "axes.labelsize": 9.0, "axes.titlesize": 9.5, "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5, "ytick.labelsize": 8.5, "axes.titlelocation": "left",
    "axes.titleweight": "bold", "axes.grid": True, "axes.axisbelow": True, "grid.color": "0.9",
    "axes.spines.top": False, "axes.spines.right": False, "lines.linewidth": 1.4,
    "lines.markersize": 4.0, "legend.frameon": False, "legend.handlelength": 1.6,
    "axes.prop_cycle": f"cycler('color', {list(COLORS)})",
    "figure.dpi": 110.0, "savefig.dpi": 160.0, "pdf.fonttype": 42,
}  # fmt: skip
RATE = 30.0  # frames of an animation per second
MARGIN = 0.08  # on each side of points, as a fraction of their larger extent
FILM_DPI = 96.0  # at which its text has the points of the style on a page
Chain = Array | tuple[Array, dict[str, Any]]


@contextmanager
def figure(
    name: str | Path, rows: int = 1, columns: int = 1, size: tuple[float, float] | None = None,
    folder: Path = FOLDER, **axes: Any,
) -> Iterator[Any]:  # fmt: skip
    """A figure that is saved at the end of the ``with`` block.

    At the end, labels that no legend shows are shown above the axes, and empty axes are not.

    Args:
        name: Path of the file; or its name in a folder, without suffix, which is printed.
        rows: Rows of axes.
        columns: Columns of axes.
        size: In inches; None for a suitable one.
        folder: Folder of a name.
        **axes: As for ``matplotlib.figure.Figure.subplots``.

    Yields:
        The axes: one, or an array of them.

    Raises:
        InvalidInput: If Matplotlib does not know the format of the file.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    path = name if isinstance(name, Path) else folder / f"{name}.png"
    with mpl.rc_context(STYLE):
        size = size or (WIDTH if columns > 1 else 5.2, 2.5 * rows + 0.4)
        fig = Figure(figsize=size, layout="constrained")
        yield fig.subplots(rows, columns, **axes)
        for axis in fig.axes:
            axis.set_visible(axis.has_data())
        if not fig.legends and not any(axis.get_legend() for axis in fig.axes):
            legend_outside(fig)
        fig.align_ylabels()
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            fig.savefig(path)
        except ValueError as error:
            raise InvalidInput(f"'{path}': {error}") from None
    if path is not name:
        print(f"figure: {path}")


def use_style() -> None:
    """Apply the suite's style to all further figures of pyplot."""
    import matplotlib as mpl

    mpl.rcParams.update(STYLE | {"figure.constrained_layout.use": True})


def legend_outside(figure: Any, below: bool = False) -> None:
    """A legend of a whole figure with constrained layout: of axes without one, each label once.

    It is above or below the axes, in as many columns as have room. Matplotlib itself makes room
    for it (``loc="outside …"``) from 3.7 on; Ubuntu 24.04 has 3.6.
    """
    line_of: dict[str, Any] = {}
    for axis in (axis for axis in figure.axes if not axis.get_legend()):
        for line, label in zip(*axis.get_legend_handles_labels(), strict=True):
            line_of.setdefault(label, line)
    for rows in range(1, len(line_of) + 1):
        columns = -(-len(line_of) // rows)
        legend = figure.legend(
            line_of.values(), line_of, loc=f"{'lower' if below else 'upper'} center", ncol=columns,
            columnspacing=1.3, borderaxespad=0.2,
        )  # fmt: skip
        box = legend.get_window_extent()
        if box.width < figure.bbox.width or columns == 1:
            height = box.height / figure.bbox.height + 0.01
            low = height if below else 0.0
            figure.set_layout_engine("constrained", rect=(0.0, low, 1.0, 1.0 - height))
            return
        legend.remove()


def show_once(result: Any, figure: Any) -> Any:
    """The result of a cell of a notebook, without the open figure that it would show again."""
    from matplotlib import pyplot

    if "inline" in pyplot.get_backend():
        result._repr_mimebundle_ = lambda **_: pyplot.close(figure)
    return result


def widest_columns(q: Array) -> list[int]:
    """Columns of positions, shape (k, n), with the widest ranges, as many as there are colours."""
    way = np.ptp(np.nan_to_num(q), axis=0)
    return sorted(np.argsort(-way, kind="stable")[: len(COLORS)].tolist())


def joint_words(names: Sequence[str]) -> list[str]:
    """Names in words, as "joint 1", without what all begin or end with up to "_" or "/"."""
    parts = [re.split("[_/]", name) for name in names]
    length = min(map(len, parts)) - 1
    first = min(len(commonprefix(parts)), length)
    last = min(len(commonprefix([part[::-1] for part in parts])), length - first)
    words = [" ".join(part[first : len(part) - last]) for part in parts]
    return [re.sub(r"(?<=[a-z]{2})(?=\d)", " ", word) for word in words]


def units(joint_types: Iterable[str], turning: str, sliding: str, between: str = ", ") -> str:
    """The unit of joints of these types, or both units if both kinds occur."""
    kinds = {kind == "prismatic" for kind in joint_types}
    return between.join([turning] * (False in kinds) + [sliding] * (True in kinds))


def animation(
    time: Array, chains: Sequence[Chain], *, trail: Chain | None = None,
    trail_time: Array | None = None, speed: float = 1.0, size: tuple[float, float] = (4.4, 4.4),
    title: str = "", frames: int | None = None, axes: str = "xz",
) -> Any:  # fmt: skip
    """An animated stick figure: polylines over time, in a plane or in space, with equal axes.

    Args:
        time: Of a recording in [s], shape (k,).
        chains: Polylines in [m], each of shape (k, m, d), or (m, d) if it does not move, for d
            axes; or a pair of that and properties of Matplotlib's ``Line2D``, of which a
            ``label`` is shown below the axes. NaN is not drawn.
        trail: Points whose path is drawn up to the current time, in [m], shape (k, d), or a pair
            likewise.
        trail_time: Times of these points in [s], if they are not those of the recording.
        speed: Speed of the animation relative to real time.
        size: In inches.
        title: Title of the figure.
        frames: Largest number of frames; None for 30 per second.
        axes: Names of the d axes: of the horizontal and of the vertical one, or "xyz".

    Returns:
        A ``matplotlib.animation.FuncAnimation``, which a notebook shows as a film; keep it as long
        as it is shown.

    Raises:
        InvalidInput: If a shape does not match ``time``, or the speed is not positive.
    """
    import matplotlib as mpl
    from matplotlib import pyplot as plt
    from matplotlib.animation import FuncAnimation

    if not speed > 0.0:
        raise InvalidInput(f"speed = {speed}; allowed: more than 0")
    time = np.asarray(time, dtype=np.float64)
    polylines = [_polyline(chain, len(time), len(axes)) for chain in chains]
    path, style = trail if isinstance(trail, tuple) else (trail, {})
    path = np.full((len(time), len(axes)), np.nan) if path is None else np.asarray(path)
    path_time = time if trail_time is None else np.asarray(trail_time)
    _polyline(path[:, None], len(path_time), len(axes))  # whose shape it checks
    frames = frames or round(RATE * (time[-1] - time[0]) / speed) + 1
    rows = np.linspace(0, len(time) - 1, min(len(time), frames)).round().astype(int).tolist()
    extent = np.vstack([*(points.reshape(-1, len(axes)) for points, _ in polylines), path])
    in_space = {"projection": "3d", "proj_type": "ortho"} if len(axes) == 3 else {}
    plt.draw_if_interactive()  # loads the backend, which may set rcParams to stay
    with mpl.rc_context(STYLE | {"figure.constrained_layout.use": True}):
        fig, picture = plt.subplots(figsize=size, dpi=FILM_DPI, subplot_kw=in_space)
        labels = {f"{own}label": f"{name} [m]" for own, name in zip("xyz", axes, strict=False)}
        picture.set(title=title, **labels)
        picture.locator_params(nbins=5 if in_space else 7)
        nothing = np.zeros((len(axes), 0))
        track = picture.plot(*nothing, **{"color": COLORS[1], "linewidth": 1.2} | style)[0]
        lines = [picture.plot(*nothing, **properties)[0] for _, properties in polylines]
        legend_outside(fig, below=True)
        clock = picture.set_title(f"{time[-1]:.2f} s", loc="right", size=9.0, weight="normal")
        for _ in range(2):  # limits follow from the layout, and labels of ticks from limits
            fill_with(picture, extent)
            fig.canvas.draw()
        fig.set_layout_engine("none")  # that of this frame is that of all
        fill_with(picture, extent)

    def place(line: Any, points: Array) -> None:
        (line.set_data_3d if in_space else line.set_data)(*points.T)

    def show(k: int) -> list[Any]:
        for line, (points, _) in zip(lines, polylines, strict=True):
            place(line, points[k])
        place(track, path[: np.searchsorted(path_time, time[k], side="right")])
        clock.set_text(f"{time[k]:.2f} s")
        return [track, *lines, clock]

    show(0)
    interval = 1e3 * (time[-1] - time[0]) / max(len(rows) - 1, 1) / speed  # [ms]
    film = FuncAnimation(fig, show, frames=rows, interval=interval)
    film._draw_was_started = True  # no warning if it stays unused, as in a script without a screen
    mpl.rcParams["animation.html"] = "jshtml"  # a notebook shows it as a film
    return show_once(film, fig)


def fill_with(axes: Any, points: Array) -> None:
    """Set limits around points, shape (k, 2 or 3), of one scale; NaN is ignored.

    In a plane the axes keep their size.
    """
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    span = high - low + 2.0 * MARGIN * max(high - low)
    span = span if span.any() else np.full(len(low), 2.0)
    if len(span) == 3:
        limits = zip((low + high - span) / 2, (low + high + span) / 2, strict=True)
        axes.set(**dict(zip(("xlim", "ylim", "zlim"), limits, strict=True)))
        axes.set_box_aspect(span, zoom=0.9)  # leaves room for the labels
        return
    box = np.array(axes.get_window_extent().size)
    half = 0.5 * box * max(span / box)
    (left, right), (bottom, top) = np.transpose([(low + high) / 2 - half, (low + high) / 2 + half])
    axes.set(xlim=(left, right), ylim=(bottom, top))


def _polyline(chain: Chain, count: int, d: int) -> tuple[Array, dict[str, Any]]:
    """A polyline of d axes at every time, and how it is drawn."""
    points, properties = chain if isinstance(chain, tuple) else (chain, {})
    points = np.asarray(points, dtype=np.float64)
    still = points.ndim == 2
    if points.ndim not in (2, 3) or points.shape[-1] != d or not (still or len(points) == count):
        raise InvalidInput(
            f"a polyline of shape {points.shape} does not match {count} times; allowed: "
            f"({count}, m, {d}), or (m, {d}) if it does not move"
        )
    style = {"color": "0.6"} if still else {"color": COLORS[0], "marker": "o", "linewidth": 2.5}
    return np.broadcast_to(points, (count, *points.shape[-2:])), style | properties
