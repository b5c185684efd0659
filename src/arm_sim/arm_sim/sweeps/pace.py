# SPDX-License-Identifier: Apache-2.0
"""How long a sweep will still take, from what its runs have taken so far."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from arm_sim.sweeps.sharing import Result

_FEW = 3  # results before anything is said


class Pace:
    """Estimates the remaining time.

    Runs of one kind cost about the same; those of a kind of which none is done yet are taken to
    cost what the others do. What counts is the time since the first result, so that starting
    processes and compiling is not taken for the cost of runs; what compiling takes later is.

    Args:
        left: Runs to make, by kind.
    """

    def __init__(self, left: Mapping[str, int]) -> None:
        self._left = Counter(left)
        self._done = Counter[str]()
        self._spent_seconds: dict[str, float] = {}
        self._began: float | None = None
        self._results, self._busy = 0, 0.0

    def note(self, result: Result, now: float) -> None:
        """Take account of a result that came at a time in [s]."""
        runs = len(result.rows)
        self._left[result.kind] -= runs
        self._done[result.kind] += runs
        cost = result.seconds + result.making
        if self._began is None:
            self._began, cost = now, result.seconds
        else:
            self._busy += cost
        self._spent_seconds[result.kind] = self._spent_seconds.get(result.kind, 0.0) + cost
        self._results += 1

    def remaining(self, now: float) -> float | None:
        """Time that is left in [s]; None while too little is known."""
        if self._results < _FEW or self._began is None or not self._busy or now <= self._began:
            return None
        side_by_side = self._busy / (now - self._began)
        return self._work_left() / side_by_side

    def _work_left(self) -> float:
        """Seconds of one worker that the runs to come will take."""
        usual = sum(self._spent_seconds.values()) / max(1, sum(self._done.values()))
        return sum(
            count * (self._spent_seconds[kind] / done if (done := self._done[kind]) else usual)
            for kind, count in self._left.items()
        )
