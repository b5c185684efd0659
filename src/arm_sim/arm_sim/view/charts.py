# SPDX-License-Identifier: Apache-2.0
"""Plots beside the arm, in a page of a server or in a standalone page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from arm_dynamics.arrays import Array

if TYPE_CHECKING:
    import viser

COLOURS = (
    "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f",
    "#bcbd22", "#17becf",
)  # fmt: skip
POINTS = 1200  # points of a curve
WIDTH = 380  # size of the panel in pixels


@dataclass(frozen=True)
class Chart:
    """Curves over time.

    Attributes:
        title: Title with the unit.
        names: Names of the curves.
        time: In [s], shape (k,).
        values: Shape (k, curves).
    """

    title: str
    names: tuple[str, ...]
    time: Array
    values: Array


def thinned(time: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Curves with fewer points, which keep their extrema.

    Of every interval of time each curve keeps its minimum and its maximum, in order.

    Args:
        time: Shape (k,).
        values: Shape (k, m).
        points: Largest number of points that remain.

    Returns:
        Times and values.
    """
    stretches = points // 2
    if len(time) <= points:
        return time, values
    edges = np.linspace(0, len(time), stretches + 1).astype(int)
    times, rows = np.empty(2 * stretches), np.empty((2 * stretches, values.shape[1]))
    columns = np.arange(values.shape[1])
    for i, (a, b) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        part = values[a:b]
        ends = np.sort([part.argmin(axis=0), part.argmax(axis=0)], axis=0)
        times[2 * i : 2 * i + 2] = time[a], time[(a + b) // 2]
        rows[2 * i : 2 * i + 2] = part[ends, columns]
    return times, rows


class Charts:
    """Tabs with curves in a panel of the page."""

    def __init__(self, server: viser.ViserServer, charts: Sequence[Chart]) -> None:
        """Draw the plots, if any."""
        self._handles = {}
        if not charts:
            return
        panel = server.gui.add_panel()
        for chart in charts:
            with panel.add_tab(chart.title):
                self._handles[chart.title] = server.gui.add_uplot(
                    _columns(chart.time, chart.values), _series(chart.names),
                    scales={"x": {"time": False, "auto": True}, "y": {"auto": True}},
                    axes=({"label": "time [s]"}, {"label": chart.title}),
                    legend={"show": True}, aspect=1.25, padding=(12, 16, 0, 0),
                )  # fmt: skip
        panel.dock_left()
        panel.set_width(WIDTH)

    def update(self, title: str, time: Array, values: Array) -> None:
        """Draw other curves of the same names."""
        self._handles[title].data = _columns(time, values)


def with_curves(page: str, charts: Sequence[Chart], times: Sequence[float], rate: float) -> str:
    """Add plots to the player of a standalone page.

    A line across them follows the player; without the player's slider, there is no line.

    Args:
        page: The page, as the library writes it.
        charts: The plots, perhaps none.
        times: Times of the motion in [s], evenly spaced, that the player's frames show.
        rate: Frames per second of the player.

    Returns:
        The page with the plots.
    """
    if not charts:
        return page
    drawn = {
        "charts": [_drawn(chart) for chart in charts], "colours": COLOURS, "width": WIDTH,
        "begin": times[0], "end": times[-1], "pictures": len(times), "rate": rate,
    }  # fmt: skip
    data = json.dumps(drawn, separators=(",", ":"), allow_nan=False)
    data = data.replace("<", "\\u003c")  # a name must not terminate the script
    fragment = (files(__package__) / "curves.html").read_text(encoding="utf-8")
    head, end, tail = page.rpartition("</body>")
    return head + fragment.replace("DRAWN", data) + end + tail


def _drawn(chart: Chart) -> dict[str, object]:
    """A chart as the page draws it: two points for each of its pixels, six digits of each."""
    time, rows = thinned(chart.time, chart.values, 2 * WIDTH)
    curves = [_digits(column) for column in rows.T]
    return {
        "title": chart.title, "names": chart.names, "time": _digits(time), "curves": curves
    }  # fmt: skip


def _digits(values: Array) -> list[float | None]:
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]


def _columns(time: Array, values: Array) -> tuple[Array, ...]:
    x, rows = thinned(np.asarray(time, dtype=float), np.asarray(values, dtype=float))
    if not len(x):  # the library draws nothing of no points
        x, rows = np.zeros(1), np.zeros((1, values.shape[1]))
    return (np.ascontiguousarray(x), *map(np.ascontiguousarray, rows.T))


def _series(names: Sequence[str]) -> tuple[dict[str, object], ...]:
    curves = [
        {"label": name, "stroke": COLOURS[i % len(COLOURS)], "width": 1.5,
         "points": {"show": False}}
        for i, name in enumerate(names)
    ]  # fmt: skip
    return ({"label": "t"}, *curves)
