# SPDX-License-Identifier: Apache-2.0
"""Progress of a sweep, with an estimate of the remaining time from the durations so far."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from arm_dynamics.attributes import frozen
from arm_studies.renaming import renamed_attribute
from arm_studies.sweeps.sharing import Result

_FEWEST = 3  # results required for an estimate


@frozen
class Progress:
    """Progress of a sweep.

    Attributes:
        done: Number of finished runs, earlier ones included.
        total: Number of all runs.
        remaining: Remaining time in [s]; None while too little is known.
        activity: What is being done.
    """

    done: int
    total: int
    remaining: float | None
    activity: str
    what = renamed_attribute("what", "activity")


class Pace:
    """Estimates the remaining time.

    Runs of one kind, in compiled code or in Python, take about the same time; a kind without
    results is assumed to take as long as the other. Time is counted from the first result, so that
    process start-up and initial compilation are excluded; later compilation is included.

    Args:
        remaining: Number of remaining runs, by whether they are compiled.
    """

    def __init__(self, remaining: Mapping[bool, int]) -> None:
        self._remaining = Counter(remaining)
        self._done = Counter[bool]()
        self._seconds: dict[bool, float] = {}  # spent on runs of each kind
        self._began: float | None = None
        self._results, self._busy = 0, 0.0

    def add(self, result: Result, now: float) -> None:
        """Count a result that arrived at a time in [s]."""
        kind, runs = result.compiled, len(result.rows)
        self._remaining[kind] -= runs
        self._done[kind] += runs
        cost = result.seconds + result.building
        if self._began is None:
            self._began, cost = now, result.seconds
        else:
            self._busy += cost
        self._seconds[kind] = self._seconds.get(kind, 0.0) + cost
        self._results += 1

    def remaining(self, now: float) -> float | None:
        """Remaining time in [s]; None while too little is known."""
        if self._results < _FEWEST or self._began is None or not self._busy or now <= self._began:
            return None
        parallel = self._busy / (now - self._began)
        of_any_kind = sum(self._seconds.values()) / max(1, sum(self._done.values()))
        work = 0.0  # that a single worker would have to do
        for kind, count in self._remaining.items():
            done = self._done[kind]
            work += count * (self._seconds[kind] / done if done else of_any_kind)
        return work / parallel
