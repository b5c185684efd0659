# SPDX-License-Identifier: Apache-2.0
"""What every study is given: who takes part, how carefully to measure, and how to say so."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from benchmarks.measurement.timing import Cost, Job, Noise, interleaved
from benchmarks.peers.base import TICK, Contestant
from benchmarks.robots.models import Robot, chain, panda, ur10

Record = dict[str, Any]


class Silent:
    """Progress that shows nothing, for tests."""

    def stage(self, text: str, total: int) -> None:
        """A stage of ``total`` jobs begins."""

    def advance(self) -> None:
        """One job is done."""


@dataclass
class Bench:
    """One run of the benchmark."""

    contestants: list[Contestant]  # ours first, then every installed peer
    quick: bool = False  # panda only and few repeats
    noise: Noise = field(default_factory=Noise)  # probe of the machine, shared by all studies
    # anything with ``stage(text, total)`` and ``advance()``
    progress: Any = field(default_factory=Silent)

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
        return interleaved(jobs, rounds, self.noise, self.progress.advance)

    def once(self, label: str, call: Callable[[], Any]) -> Any:
        self.progress.stage(label, 1)
        done = call()
        self.progress.advance()
        return done

    def each(self, label: str, items: list[Any]) -> Iterator[Any]:
        """Iterate with progress, for work that is not timed."""
        self.progress.stage(label, len(items))
        for item in items:
            yield item
            self.progress.advance()

    def thinned(self, settings: tuple[float, ...]) -> tuple[float, ...]:
        """All settings, or every other one (1 ms and 1e-9 among them) when it has to be quick."""
        if not self.quick:
            return settings
        return settings[TICK in settings and settings.index(TICK) % 2 :: 2]
