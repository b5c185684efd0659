# SPDX-License-Identifier: Apache-2.0
"""Plots beside the arm."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.figures import COLORS
from arm_sim.recording.figure import thinned
from arm_sim.view.framing import TALL

if TYPE_CHECKING:
    import viser

POINTS = 1200  # points of a curve
FLAT = 1e-9  # what is not told from zero, relative to 1 or to the largest value
WIDTH = 380  # size of the panel in pixels


class Charts:
    """Tabs with curves, of these names by title of a plot, in a panel of the page."""

    def __init__(self, server: viser.ViserServer, names: Mapping[str, Sequence[str]]) -> None:
        self._panel = panel = server.gui.add_panel()
        self._names, self._handles = names, dict[str, tuple[Any, Any]]()
        self._curves = dict[str, tuple[Array, Array]]()
        for title, curves in names.items():
            hidden = {"label": "", "width": 0, "points": {"show": False}}
            series = [
                {"label": name, "stroke": COLORS[i % len(COLORS)], "width": 1.5,
                 "points": {"show": False}}
                for i, name in enumerate(curves)
            ]  # fmt: skip
            with panel.add_tab(title):
                plot = server.gui.add_uplot(
                    tuple(np.zeros(0) for _ in range(len(curves) + 2)),
                    ({"label": "t"}, *series, hidden),
                    scales={"x": {"time": False, "auto": True}, "y": {"auto": True}},
                    axes=({"label": "time [s]"}, {"label": title}),
                    legend={"show": False}, aspect=1.25, padding=(12, 16, 0, 0),
                )  # fmt: skip
                self._handles[title] = plot, server.gui.add_html("")
            self.draw(title, np.zeros(0), np.zeros((0, len(curves))))
        panel.dock_left()
        panel.set_width(WIDTH)
        server.on_client_connect(self._welcome)

    def draw(self, title: str, time: Array, values: Array) -> None:
        """Draw curves, values of shape (k, curves); the legend has their last values."""
        self._curves[title] = time, values
        self._handles[title][0].data = _columns(time, values)
        self._read(title, len(time) - 1)

    def read(self, time: float) -> None:
        """Show the values at a time in [s] in the legends."""
        for title, (times, _) in self._curves.items():
            self._read(title, int(np.searchsorted(times, time + 1e-9)) - 1)

    def _read(self, title: str, row: int) -> None:
        """Write the legend of a plot, with the values of a row, or without, if there is none."""
        time, values = self._curves[title]
        shown = values[max(row, 0)] if len(time) else np.full(len(self._names[title]), np.nan)
        text, handle = legend(self._names[title], shown), self._handles[title][1]
        if handle.content != text:
            handle.content = text

    async def _welcome(self, client: viser.ClientHandle) -> None:
        """Fold the plots away for a visitor whose picture they leave too narrow."""
        folded = False

        async def look(_: object = None) -> None:
            nonlocal folded
            if client.camera.aspect < TALL and not folded:
                folded = True
                panel = client.gui.main_panel  # commands of a client, for a panel that all have
                panel._placement_uuid = self._panel._placement_uuid
                panel.minimize()

        client.camera.on_update(look)
        await look()


class RollingCharts:
    """Torques, errors and energies of the last seconds of arms with joints of these names."""

    def __init__(
        self, server: viser.ViserServer, joints: Mapping[str, Sequence[str]],
        energies: Sequence[str], memory: float, sampled: float,
    ) -> None:  # fmt: skip
        self._sampled, self._drawn = sampled, 0.0
        self._samples: dict[str, deque[tuple[float, Sequence[Array]]]] = {
            arm: deque(maxlen=round(memory / sampled)) for arm in joints
        }
        self._titles: dict[str, dict[str, Sequence[str]]] = {}
        for arm, names in joints.items():
            of = f"{arm}: " if len(joints) > 1 else ""
            self._titles[arm] = {
                f"{of}torque [N m]": names, f"{of}error [rad]": names, f"{of}energy [J]": energies
            }  # fmt: skip
        tabs = [x for each in self._titles.values() for x in each.items()]
        self._charts = Charts(server, dict(sorted(tabs)))  # energy first, which is never flat

    def add(self, arm: str, time: float, values: Callable[[], Sequence[Array]]) -> None:
        """Add what ``values`` returns for each plot, if the last point is old enough."""
        samples = self._samples[arm]
        if not samples or time - samples[-1][0] >= self._sampled - 1e-9:
            samples.append((time, values()))

    def clear(self, arm: str) -> None:
        """Restart the plots of an arm."""
        self._samples[arm].clear()

    def draw(self, pause: float = 0.0) -> bool:
        """Draw what is known, unless it was drawn less than ``pause`` ago, in [s]."""
        if monotonic() - self._drawn < pause:
            return False
        self._drawn = monotonic()
        for arm, titles in self._titles.items():
            for i, (title, names) in enumerate(titles.items()):
                rows = [(time, *values[i]) for time, values in self._samples[arm]]
                table = np.array(rows).reshape(-1, 1 + len(names))
                known = table[np.isfinite(table[:, 1:]).any(axis=1)]
                self._charts.draw(title, known[:, 0], known[:, 1:])
        return True


def legend(names: Sequence[str], values: Array) -> str:
    """A legend as HTML: colours, names, and values with four digits, shape (curves,)."""
    largest = np.nan_to_num(abs(values)).max(initial=1.0)
    rows = [
        f'<span style="color:{COLORS[i % len(COLORS)]}">&#9632;</span>'
        f"<span>{html.escape(name)}</span>"
        f'<span style="text-align:right">{_number(value, FLAT * largest)}</span>'
        for i, (name, value) in enumerate(zip(names, values.tolist(), strict=True))
    ]
    grid = "display:grid;grid-template-columns:1em 1fr auto;gap:0 0.5em"
    return (
        f'<div style="{grid};font-size:0.8em;font-variant-numeric:tabular-nums;padding:0 1em">'
        f"{''.join(rows)}</div>"
    )


def _number(value: float, nothing: float) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.4g}" if abs(value) > nothing else "0"


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
        x, rows = np.array([end - 1.0, end]), np.resize(rows, (2, values.shape[1]))
    room = np.full(len(x), middle)
    room[[0, -1]] = middle - half, middle + half
    return (np.ascontiguousarray(x), *map(np.ascontiguousarray, rows.T), room)
