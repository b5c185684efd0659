# SPDX-License-Identifier: Apache-2.0
"""Plots beside the arm."""

from __future__ import annotations

import html
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_sim.figures import COLORS
from arm_sim.recording.figure import thinned
from arm_sim.view.framing import PORTRAIT_BELOW

if TYPE_CHECKING:
    import viser

POINTS = 1200  # points of a curve
FLAT = 1e-9  # values that count as zero, relative to 1 or to the largest value
WIDTH = 380  # size of the panel in pixels

# Titles of rolling plots by field of a sample, in their order: energies are never all zero
ROLLING = {"energies": "energy [J]", "error": "error [rad]", "torque": "torque [N m]"}


class Sample(NamedTuple):
    """Values of an arm at one time; NaN where they are unknown."""

    torque: Array  # in [N m] or [N], shape (n,)
    error: Array  # from the reference in [rad] or [m], shape (n,)
    energies: Array  # in [J]


class Chart:
    """A plot of curves of these names, and a legend with their values, on a tab of the page."""

    def __init__(self, gui: viser.GuiApi, title: str, names: Sequence[str]) -> None:
        hidden = {"label": "", "width": 0, "points": {"show": False}}
        series = [
            {"label": name, "stroke": COLORS[i % len(COLORS)], "width": 1.5,
             "points": {"show": False}}
            for i, name in enumerate(names)
        ]  # fmt: skip
        self.names = names
        self.plot = gui.add_uplot(
            tuple(np.zeros(0) for _ in range(len(names) + 2)), ({"label": "t"}, *series, hidden),
            scales={"x": {"time": False, "auto": True}, "y": {"auto": True}},
            axes=({"label": "time [s]"}, {"label": title}),
            legend={"show": False}, aspect=1.25, padding=(12, 16, 0, 0),
        )  # fmt: skip
        self.legend = gui.add_html("")
        self.draw(np.zeros(0), np.zeros((0, len(names))))

    def draw(self, time: Array, values: Array) -> None:
        """Draw curves, values of shape (k, curves); the legend has their last values."""
        self.time, self.values = time, values
        self.plot.data = _columns(time, values)
        self.show_values(np.inf)

    def show_values(self, time: float) -> None:
        """Show the values at a time in [s] in the legend, the first ones before all."""
        row = max(int(np.searchsorted(self.time, time + 1e-9)) - 1, 0)
        values = self.values[row] if len(self.time) else np.full(len(self.names), np.nan)
        text = legend(self.names, values)
        if self.legend.content != text:
            self.legend.content = text


class ChartPanel:
    """A panel of the page with charts by title, each on a tab."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._gui, self._panel = server.gui, server.gui.add_panel()
        self._panel.dock_left()
        self._panel.set_width(WIDTH)
        self.charts = dict[str, Chart]()
        server.on_client_connect(self._welcome)

    def add(self, title: str, names: Sequence[str]) -> Chart:
        """Add a chart with curves of these names."""
        with self._panel.add_tab(title):
            self.charts[title] = Chart(self._gui, title, names)
        return self.charts[title]

    def show_values(self, time: float) -> None:
        """Show the values at a time in [s] in all legends."""
        for chart in self.charts.values():
            chart.show_values(time)

    async def _welcome(self, client: viser.ClientHandle) -> None:
        """Fold the plots away for a visitor whose picture they leave too narrow."""
        folded = False

        async def fold_if_narrow(_: object = None) -> None:
            nonlocal folded
            if client.camera.aspect < PORTRAIT_BELOW and not folded:
                folded = True
                panel = client.gui.main_panel  # commands of a client, for a panel that all have
                panel._placement_uuid = self._panel._placement_uuid
                panel.minimize()

        client.camera.on_update(fold_if_narrow)
        await fold_if_narrow()


class RollingCharts:
    """Torques, errors and energies of the last seconds of arms with joints of these names."""

    def __init__(
        self, server: viser.ViserServer, joints: Mapping[str, Sequence[str]],
        energies: Sequence[str], memory: float, sample_period: float,
    ) -> None:  # fmt: skip
        self._sample_period, self._last_draw = sample_period, 0.0
        length = round(memory / sample_period)
        self._samples = {arm: deque[tuple[float, Sample]](maxlen=length) for arm in joints}
        self._panel, self._charts = ChartPanel(server), dict[str, dict[str, Chart]]()
        for arm, names in joints.items():
            of = f"{arm}: " if len(joints) > 1 else ""
            self._charts[arm] = {
                field: self._panel.add(of + title, energies if field == "energies" else names)
                for field, title in ROLLING.items()
            }

    def add(self, arm: str, time: float, sample: Callable[[], Sample]) -> None:
        """Add the sample that a function returns, if the last one is old enough."""
        samples = self._samples[arm]
        if not samples or time - samples[-1][0] >= self._sample_period - 1e-9:
            samples.append((time, sample()))

    def clear(self, arm: str) -> None:
        """Restart the plots of an arm."""
        self._samples[arm].clear()

    def draw(self, pause: float = 0.0) -> bool:
        """Draw all samples, unless they were drawn less than ``pause`` ago, in [s]."""
        if monotonic() - self._last_draw < pause:
            return False
        self._last_draw = monotonic()
        for arm, samples in self._samples.items():
            for field, chart in self._charts[arm].items():
                rows = [(time, *getattr(sample, field)) for time, sample in samples]
                table = np.array(rows).reshape(-1, 1 + len(chart.names))
                finite = table[np.isfinite(table[:, 1:]).any(axis=1)]
                chart.draw(finite[:, 0], finite[:, 1:])
        return True


def legend(names: Sequence[str], values: Array) -> str:
    """A legend as HTML: colours, names, and values with four digits, shape (curves,)."""
    largest = np.nan_to_num(abs(values)).max(initial=1.0)
    rows = [
        f'<span style="color:{COLORS[i % len(COLORS)]}">&#9632;</span>'
        f"<span>{html.escape(name)}</span>"
        f'<span style="text-align:right">{_number(value, zero=FLAT * largest)}</span>'
        for i, (name, value) in enumerate(zip(names, values.tolist(), strict=True))
    ]
    grid = "display:grid;grid-template-columns:1em 1fr auto;gap:0 0.5em"
    return (
        f'<div style="{grid};font-size:0.8em;font-variant-numeric:tabular-nums;padding:0 1em">'
        f"{''.join(rows)}</div>"
    )


def _number(value: float, zero: float) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.4g}" if abs(value) > zero else "0"


def _columns(time: Array, values: Array) -> tuple[Array, ...]:
    """Times, curves, and an invisible curve that opens the axes where there is nothing to see.

    The library would draw axes from 0 to 100 about zeros and single points.
    """
    x, rows = thinned(np.asarray(time, dtype=float), np.asarray(values, dtype=float), POINTS)
    finite = rows[np.isfinite(rows)]
    middle = float(finite.mean()) if finite.size else 0.0
    flat = not finite.size or np.ptp(finite) <= FLAT * max(1.0, abs(middle))
    if len(x) < 2:  # a flat second before it
        end = float(x[0]) if len(x) else 0.0
        x, rows = np.array([end - 1.0, end]), np.resize(rows, (2, values.shape[1]))
    invisible = np.full(len(x), middle)
    if flat:
        invisible[[0, -1]] = middle - 1.0, middle + 1.0
    return (np.ascontiguousarray(x), *map(np.ascontiguousarray, rows.T), invisible)
