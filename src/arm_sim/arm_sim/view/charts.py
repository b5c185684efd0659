# SPDX-License-Identifier: Apache-2.0
"""Plots beside the arm, in a page of a server or in a standalone page."""

from __future__ import annotations

import html
import json
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_sim.figures import COLORS
from arm_sim.recording.figure import thinned
from arm_sim.view.framing import TALL

if TYPE_CHECKING:
    import viser

POINTS = 1200  # points of a curve
FLAT = 1e-9  # range of values, relative to them or to 1, that is not drawn as a change
WIDTH = 380  # size of the panel in pixels


@frozen
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


Samples = deque[tuple[float, Array]]
"""Times, and values of curves then."""


def gathered(samples: Samples, width: int) -> tuple[Array, Array]:
    """Times and values, shapes (k,) and (k, width)."""
    times, rows = [time for time, _ in samples], [row for _, row in samples]
    return np.array(times), np.array(rows).reshape(-1, width)


class Charts:
    """Tabs with curves in a panel of the page."""

    def __init__(self, server: viser.ViserServer, charts: Sequence[Chart]) -> None:
        """Draw the plots, if any."""
        self._handles, self._charts = {}, {chart.title: chart for chart in charts}
        if not charts:
            return
        self._panel = panel = server.gui.add_panel()
        for chart in charts:
            with panel.add_tab(chart.title):
                plot = server.gui.add_uplot(
                    _columns(chart.time, chart.values), _series(chart.names),
                    scales={"x": {"time": False, "auto": True}, "y": {"auto": True}},
                    axes=({"label": "time [s]"}, {"label": chart.title}),
                    legend={"show": False}, aspect=1.25, padding=(12, 16, 0, 0),
                )  # fmt: skip
                self._handles[chart.title] = plot, server.gui.add_html("")
            self._tell(chart, len(chart.time) - 1)
        panel.dock_left()
        panel.set_width(WIDTH)
        server.on_client_connect(self._welcome)

    def update(self, title: str, time: Array, values: Array) -> None:
        """Draw other curves of the same names; the legend has their last values."""
        self._charts[title] = chart = replace(self._charts[title], time=time, values=values)
        self._handles[title][0].data = _columns(time, values)
        self._tell(chart, len(time) - 1)

    def read(self, time: float) -> None:
        """Show the values at a time in [s] in the legends."""
        for chart in self._charts.values():
            self._tell(chart, int(np.searchsorted(chart.time, time + 1e-9)) - 1)

    def _tell(self, chart: Chart, row: int) -> None:
        """Write the legend of a plot, with the values of a row, or without, if there is none."""
        nothing = np.full(len(chart.names), np.nan)
        values = chart.values[max(row, 0)] if len(chart.time) else nothing
        text = legend(chart.names, values)
        handle = self._handles[chart.title][1]
        if handle.content != text:
            handle.content = text

    def _welcome(self, client: viser.ClientHandle) -> None:
        """Fold the plots away for a visitor whose picture they leave too narrow."""
        folded = Event()

        def look(_: object = None) -> None:
            if client.camera.aspect < TALL and not folded.is_set():
                folded.set()
                panel = client.gui.main_panel  # commands of a client, for a panel that all have
                panel._placement_uuid = self._panel._placement_uuid
                panel.minimize()

        client.camera.on_update(look)
        look()


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
        "charts": [_drawn(chart) for chart in charts], "colours": COLORS, "width": WIDTH,
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


def legend(names: Sequence[str], values: Array) -> str:
    """A legend as HTML: colours, names, and values with four digits, shape (curves,)."""
    rows = [
        f'<span style="color:{COLORS[i % len(COLORS)]}">&#9632;</span>'
        f"<span>{html.escape(name)}</span>"
        f'<span style="text-align:right">{_number(value)}</span>'
        for i, (name, value) in enumerate(zip(names, values.tolist(), strict=True))
    ]
    grid = "display:grid;grid-template-columns:1em 1fr auto;gap:0 0.5em"
    return (
        f'<div style="{grid};font-size:0.8em;font-variant-numeric:tabular-nums;padding:0 1em">'
        f"{''.join(rows)}</div>"
    )


def _number(value: float) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.4g}" if abs(value) > FLAT else "0"


def _columns(time: Array, values: Array) -> tuple[Array, ...]:
    """Times, curves, and an invisible curve that opens the axes where there is nothing to see.

    The library would draw axes from 0 to 100 about zeros and single points.
    """
    x, rows = thinned(np.asarray(time, dtype=float), np.asarray(values, dtype=float), POINTS)
    seen = rows[np.isfinite(rows)]
    middle = float(seen.mean()) if seen.size else 0.0
    half = 0.0 if seen.size and np.ptp(seen) > FLAT * max(1.0, abs(middle)) else 1.0
    if len(x) < 2:  # a flat second before it
        end = float(x[0]) if len(x) else 0.0
        x = np.array([end - 1.0, end])
        rows = np.repeat(rows, 2, axis=0) if len(rows) else np.zeros((2, values.shape[1]))
    room = np.full(len(x), middle)
    room[[0, -1]] = middle - half, middle + half
    return (np.ascontiguousarray(x), *map(np.ascontiguousarray, rows.T), room)


def _series(names: Sequence[str]) -> tuple[dict[str, object], ...]:
    curves = [
        {"label": name, "stroke": COLORS[i % len(COLORS)], "width": 1.5,
         "points": {"show": False}}
        for i, name in enumerate(names)
    ]  # fmt: skip
    return ({"label": "t"}, *curves, {"label": "", "width": 0, "points": {"show": False}})
