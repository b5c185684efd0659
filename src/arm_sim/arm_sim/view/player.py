# SPDX-License-Identifier: Apache-2.0
"""Plays motions: at any time and speed, repeatedly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from arm_sim.view.charts import Chart, Charts
from arm_sim.view.draw_loop import DrawLoop
from arm_sim.view.film import Film
from arm_sim.view.stage import DrawnArm

if TYPE_CHECKING:
    import viser

SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", "10")
WAY_POINTS = 1500  # points of the path of a hand


class Player:
    """The controls of a page that shows motions.

    Args:
        server: The page.
        films: The motions, one for each actor; they begin together.
        actors: The arms.

    Attributes:
        loop: Its thread.
        time: Time in [s] of the picture.
        begin: Start time of the motions.
        end: End time of the longest.
        charts: Plots beside them.
    """

    def __init__(
        self, server: viser.ViserServer, films: Sequence[Film], actors: Sequence[DrawnArm]
    ) -> None:
        self._server, self._pairs = server, tuple(zip(films, actors, strict=True))
        self.begin = min(float(film.time[0]) for film in films)
        self.end = max(float(film.time[-1]) for film in films)
        self.time, self._playing = self.begin, False
        self.loop = DrawLoop(self._beat, self._show_status)
        gui = server.gui
        step = max(round((self.end - self.begin) / 20000, 3), 1e-3)
        first, last = np.floor(self.begin * 1e3) / 1e3, np.ceil(self.end * 1e3) / 1e3
        self._slider = gui.add_slider(
            "time [s]", float(first), max(float(last), float(first) + step), step, float(first)
        )
        self._button = gui.add_button("Play")
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        self._loop = gui.add_checkbox("loop", True)
        self._status = gui.add_markdown("")
        self._button.on_click(lambda _: self.loop.order(self._toggle))
        self._slider.on_update(self.loop.moved(self.seek))
        self.charts = tuple(chart for pair in self._pairs for chart in self._charted(*pair))
        self._charts = Charts(server, self.charts)
        for film, actor in self._pairs:
            rows = np.unique(np.linspace(0, len(film.time) - 1, WAY_POINTS).astype(int))
            actor.show_path(actor.marker.path(film.q[rows]))
        self.seek(self.begin)

    def play(self, on: bool = True) -> None:
        """Start or stop playing; for the thread of the loop."""
        if on and self.time >= self.end:
            self.seek(self.begin)
        self._playing = on
        self._button.label = "Pause" if on else "Play"

    def seek(self, time: float) -> None:
        """Show a time in [s]; for the thread of the loop."""
        self.time = min(max(time, self.begin), self.end)
        with self._server.atomic():
            for film, actor in self._pairs:
                actor.draw(film.at(self.time))
        self._slider.value = self.time
        self._charts.read(self.time)
        self._show_status("")

    def _charted(self, film: Film, actor: DrawnArm) -> Iterator[Chart]:
        """A film's plots, with the arm's name if there are several."""
        title = f"{actor.name}: " if len(self._pairs) > 1 else ""
        return (replace(chart, title=title + chart.title) for chart in film.charts)

    def _toggle(self) -> None:
        self.play(not self._playing)

    def _beat(self, passed: float) -> None:
        if not self._playing:
            return
        time = self.time + passed * float(self._speed.value)
        if time < self.end:
            self.seek(time)
        elif self._loop.value and self.end > self.begin:
            self.seek(self.begin)
        else:
            self.seek(self.end)
            self.play(False)

    def _show_status(self, trouble: str) -> None:
        text = f"t = {self.time:.3f} s of {self.end:.3f} s"
        self._status.content = f"{text}\n\n**{trouble}**" if trouble else text
