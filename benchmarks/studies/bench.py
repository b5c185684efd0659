# SPDX-License-Identifier: Apache-2.0
"""What every study is given: who takes part, how carefully to measure, and how to say so."""

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from benchmarks.measurement.timing import Cost, Job, Noise, interleaved
from benchmarks.peers.base import TICK, Contestant
from benchmarks.reporting.progress import Bar
from benchmarks.robots.models import Robot, chain, panda, ur10

Record = dict[str, Any]


@dataclass
class Bench:
    """One run of the benchmark."""

    contestants: list[Contestant]  # ours first, then every installed peer
    progress: Bar
    quick: bool = False  # panda only and few repeats
    noise: Noise = field(default_factory=Noise)  # probe of the machine, shared by all studies

    @property
    def repeats(self) -> int:
        """Rounds of interleaved measurements; fewer than six leave verdicts on times open."""
        return 3 if self.quick else 7

    def robots(self) -> list[Robot]:
        return [panda()] if self.quick else [panda(), ur10(), chain(6)]

    def time[Name: Hashable](
        self, label: str, jobs: Mapping[Name, Job], repeats: int | None = None
    ) -> dict[Name, Cost]:
        """Median cost of each job, interleaved, with progress."""
        rounds = self.repeats if repeats is None else repeats
        self.progress.stage(label, len(jobs) * rounds)
        return interleaved(jobs, rounds, self.noise, self.progress.done)

    def each(self, label: str, items: list[Any]) -> Iterator[Any]:
        """Iterate with progress, for work that is not timed."""
        self.progress.stage(label, len(items))
        for item in items:
            yield item
            self.progress.done()

    def thinned(self, settings: tuple[float, ...]) -> tuple[float, ...]:
        """All settings, or every other one (1 ms and 1e-9 among them) when it has to be quick."""
        if not self.quick:
            return settings
        return settings[TICK in settings and settings.index(TICK) % 2 :: 2]
