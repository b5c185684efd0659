# SPDX-License-Identifier: Apache-2.0
"""Estimate of the remaining time of a sweep from the durations of its runs so far."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from arm_studies.sweeps.sharing import Result

_FEW = 3  # results required for an estimate


class Pace:
    """Estimates the remaining time.

    Runs of one kind, in compiled code or in Python, take about the same time; a kind without
    results is assumed to take as long as the other. Time is counted from the first result, so that
    process start-up and initial compilation are excluded; later compilation is included.

    Args:
        left: Number of remaining runs, by whether they are compiled.
    """

    def __init__(self, left: Mapping[bool, int]) -> None:
        self._left = Counter(left)
        self._done = Counter[bool]()
        self._spent_seconds: dict[bool, float] = {}
        self._began: float | None = None
        self._results, self._busy = 0, 0.0

    def note(self, result: Result, now: float) -> None:
        """Record a result that arrived at a time in [s]."""
        kind, runs = result.compiled, len(result.rows)
        self._left[kind] -= runs
        self._done[kind] += runs
        cost = result.seconds + result.building
        if self._began is None:
            self._began, cost = now, result.seconds
        else:
            self._busy += cost
        self._spent_seconds[kind] = self._spent_seconds.get(kind, 0.0) + cost
        self._results += 1

    def remaining(self, now: float) -> float | None:
        """Remaining time in [s]; None while too little is known."""
        if self._results < _FEW or self._began is None or not self._busy or now <= self._began:
            return None
        side_by_side = self._busy / (now - self._began)
        usual = sum(self._spent_seconds.values()) / max(1, sum(self._done.values()))
        work_left = sum(  # of a single worker
            count * (self._spent_seconds[kind] / done if (done := self._done[kind]) else usual)
            for kind, count in self._left.items()
        )
        return work_left / side_by_side
