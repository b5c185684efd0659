# SPDX-License-Identifier: Apache-2.0
"""What came of each fault, and of a whole soak."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

WARM = 0.15  # of the time before memory is looked at


@dataclass
class Outcome:
    """What came of one fault, over all times it was done.

    Attributes:
        times: How often it was done.
        told: How often the diagnostics told of it.
        well: How often everything was well again in time.
        worst: Largest tracking error meanwhile in [rad].
        words: An example of what was told.
        trouble: What was not as it should be, the first few.
    """

    times: int = 0
    told: int = 0
    well: int = 0
    worst: float = 0.0
    words: str = ""
    trouble: list[str] = field(default_factory=list)


@dataclass
class Result:
    """A whole soak.

    Attributes:
        minutes: How long it was.
        outcomes: By the fault's name.
        memory: Of each process: times in [s] and sizes in [MB].
        share: Processor share of each process over the run.
        rates: Ticks per second of the simulation between faults.
        calls: Service calls that were answered.
        energies: Energy messages that came.
        stale: When commands were called stale: the fault's name, the simulation, and the time in
            [s] of the system's clock.
        paused: Faults of those before which commands had paused.
        false: Faults of those before which commands had not paused.
        dropped: Intervals in [s] of the system's clock in which ticks were dropped.
        stamps: Recorded stamps of the clock.
        uneven: Those out of step by more than ``stamps.UNEVEN`` of a period: when they were sent,
            and their distance from those before, in [s].
        unexplained: Those of these without dropped ticks that they make up for.
        lost: Ticks and messages that are not in the recordings.
        ended: Why it ended early, else empty.
    """

    minutes: float
    outcomes: dict[str, Outcome] = field(default_factory=dict)
    memory: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    share: dict[str, float] = field(default_factory=dict)
    rates: list[float] = field(default_factory=list)
    calls: int = 0
    energies: int = 0
    stale: list[tuple[str, str, float]] = field(default_factory=list)
    paused: list[str] = field(default_factory=list)
    false: list[str] = field(default_factory=list)
    dropped: list[tuple[float, float]] = field(default_factory=list)
    stamps: int = 0
    uneven: list[tuple[float, float]] = field(default_factory=list)
    unexplained: int = 0
    lost: int = 0
    ended: str = ""

    def growth(self, name: str) -> float:
        """How much a process's memory grew after warming up, in [MB]: medians of tenths."""
        history = self.memory[name]
        sizes = [size for t, size in history if t >= WARM * history[-1][0]]
        tenth = max(1, len(sizes) // 10)
        return float(np.median(sizes[-tenth:]) - np.median(sizes[:tenth])) if sizes else 0.0
