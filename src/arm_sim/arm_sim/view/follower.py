# SPDX-License-Identifier: Apache-2.0
"""Follows running arms, and draws their states."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_sim.view.charts import Chart, Charts, Samples, gathered
from arm_sim.view.draw_loop import DrawLoop
from arm_sim.view.marks import Instant
from arm_sim.view.stage import DrawnArm

if TYPE_CHECKING:
    import viser

MEMORY, SAMPLED = 20.0, 0.05  # [s] that curves go back, and between their points
CHARTED = 0.5  # [s] between drawings of curves
OLD = 0.5  # [s] without data after which an arm is reported as silent
ENERGIES = ("kinetic", "potential", "total", "supplied", "dissipated")


@frozen
class News:
    """The newest data of an arm.

    Attributes:
        time: Its time in [s].
        q: Joint positions in [rad] or [m], shape (n,).
        effort: Torques in [N m] or [N], shape (n,).
        error: Errors from its reference, shape (n,); zeros if unknown.
        energy: The ``ENERGIES`` in [J], shape (5,); zeros if unknown.
    """

    time: float
    q: Array
    effort: Array
    error: Array
    energy: Array = field(default_factory=lambda: np.zeros(len(ENERGIES)))


class NewsSource(Protocol):
    """A source of data of an arm."""

    def newest(self) -> News | None:
        """The newest data; None if there is nothing new since the last call."""


class Follower:
    """The controls of a page that follows running arms; times count from the first data.

    Args:
        server: The page.
        told: Source of data of each actor.
        actors: The arms.

    Attributes:
        loop: Its thread.
    """

    def __init__(
        self, server: viser.ViserServer, told: Sequence[NewsSource], actors: Sequence[DrawnArm]
    ) -> None:
        self._server, self._pairs = server, tuple(zip(told, actors, strict=True))
        self.loop = DrawLoop(self._beat, self._show_status)
        self._status = server.gui.add_markdown("waiting")
        forget = server.gui.add_button("Clear path")
        forget.on_click(lambda _: self.loop.order(self._forget))
        size = round(MEMORY / SAMPLED)
        self._samples = [Samples(maxlen=size) for _ in actors]
        self._heard = [0.0 for _ in actors]
        self._began: dict[int, float] = {}
        self._times = [0.0 for _ in actors]
        self._charted = 0.0
        self._charts = Charts(server, self._curves())
        with server.atomic():
            for actor in actors:
                actor.draw(Instant(0.0, actor.marker.model.q0))

    def _forget(self) -> None:
        for _, actor in self._pairs:
            actor.forget_way()

    def _beat(self, passed: float) -> None:
        now = time.monotonic()
        for i, (told, actor) in enumerate(self._pairs):
            if (news := told.newest()) is not None:
                news = replace(news, time=news.time - self._began.setdefault(i, news.time))
                self._heard[i], self._times[i] = now, news.time
                self._take(news, actor, self._samples[i])
        if now - self._charted > CHARTED:
            self._charted = now
            self._show_status("")
            for chart in self._curves():
                self._charts.update(chart.title, chart.time, chart.values)

    def _take(self, news: News, actor: DrawnArm, samples: Samples) -> None:
        with self._server.atomic():
            actor.trail(actor.draw(Instant(news.time, news.q)).hand)
        if samples and news.time < samples[-1][0]:  # it was restarted
            samples.clear()
            actor.forget_way()
        if not samples or news.time - samples[-1][0] >= SAMPLED:
            row = np.concatenate([news.effort, news.error, news.energy])
            samples.append((news.time, row))

    def _show_status(self, trouble: str) -> None:
        now, lines = time.monotonic(), []
        for (_, actor), heard, at in zip(self._pairs, self._heard, self._times, strict=True):
            silent = f", silent for {now - heard:.0f} s" if now - heard > OLD else ""
            lines.append(f"{actor.name}: t = {at:.2f} s{silent if heard else ', no data yet'}")
        self._status.content = "\n\n".join([*lines, *([f"**{trouble}**"] if trouble else [])])

    def _curves(self) -> list[Chart]:
        charts = []
        for (_, actor), samples in zip(self._pairs, self._samples, strict=True):
            model = actor.marker.model
            n, names = model.n, model.joint_names
            title = f"{actor.name}: " if len(self._pairs) > 1 else ""
            at, rows = gathered(samples, 2 * n + len(ENERGIES))
            charts += [
                Chart(f"{title}torque [N m]", names, at, rows[:, :n]),
                Chart(f"{title}error [rad]", names, at, rows[:, n : 2 * n]),
                Chart(f"{title}energy [J]", ENERGIES, at, rows[:, 2 * n :]),
            ]
        return charts
