# SPDX-License-Identifier: Apache-2.0
"""How time is taken: processor time of the process, rounds interleaved, medians."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field

import numpy as np

Job = Callable[[], float]  # runs once and returns what it cost [s]
SHORTEST = 4e-3  # [s], a sample shorter than this is repeated and averaged


@dataclass(frozen=True)
class Cost:
    """Median and quartiles of the samples of one job, and the samples, in the unit of the job."""

    median: float
    low: float
    high: float
    samples: tuple[float, ...] = ()

    @classmethod
    def of(cls, samples: list[float]) -> Cost:
        low, median, high = np.percentile(samples, [25, 50, 75])
        return cls(float(median), float(low), float(high), tuple(samples))

    def scaled(self, factor: float) -> Cost:
        """The same in another unit."""
        samples = tuple(sample * factor for sample in self.samples)
        return Cost(self.median * factor, self.low * factor, self.high * factor, samples)


@dataclass
class Noise:
    """A fixed piece of arithmetic, timed between all the others: what the machine itself does."""

    samples: list[float] = field(default_factory=list)
    loads: list[float] = field(default_factory=list)

    def probe(self) -> None:
        """Time the same work once more and note the load average."""
        start = time.process_time()
        x = 0.5
        for _ in range(40_000):
            x = 3.9 * x * (1.0 - x)
        self.samples.append(time.process_time() - start)
        self.loads.append(os.getloadavg()[0])

    def summary(self) -> dict[str, float]:
        """Spread of the probe as a fraction of its median, and the load averages met."""
        if not self.samples:
            self.probe()
        low, median, high = np.percentile(self.samples, [10, 50, 90])
        return {
            "probes": len(self.samples),
            "median_ms": float(median * 1e3),
            "spread_10_90": float((high - low) / median),
            "load_min": min(self.loads),
            "load_max": max(self.loads),
        }


def cpu(call: Callable[[], object]) -> float:
    """Processor time [s] of one call, in all threads."""
    start = time.process_time()
    call()
    return time.process_time() - start


def steady(prepare: Callable[[], object], call: Callable[[], object]) -> Job:
    """A job long enough for the clock: ``prepare`` untimed and ``call`` timed, averaged."""

    def once() -> float:
        prepare()
        return cpu(call)

    once()
    count = max(1, min(1000, math.ceil(SHORTEST / max(once(), 1e-7))))
    return lambda: sum(once() for _ in range(count)) / count


def interleaved[Name: Hashable](
    jobs: Mapping[Name, Job], repeats: int, noise: Noise, advance: Callable[[], object]
) -> dict[Name, Cost]:
    """Run every job once, then every job again, …, so that a slow minute hits all alike."""
    samples: dict[Name, list[float]] = {name: [] for name in jobs}
    for _ in range(repeats):
        noise.probe()
        for name, job in jobs.items():
            samples[name].append(job())
            advance()
    return {name: Cost.of(values) for name, values in samples.items()}
