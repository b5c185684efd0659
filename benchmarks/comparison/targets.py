# SPDX-License-Identifier: Apache-2.0
"""What an error costs: the cheapest way of each simulator to reach it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from benchmarks.studies.bench import Record

TARGETS = (1e-2, 1e-4, 2e-6, 1e-9)  # [rad]


def cheapest(points: Iterable[Record], target: float) -> tuple[float, str] | None:
    """Least processor time [s] at an error of at most ``target``, and the method.

    Each method's points are joined by straight lines in log–log, so that the luck of where a
    step happens to lie plays no part.
    """
    curves: dict[str, list[tuple[float, float]]] = {}
    for p in points:
        if p["error_rad"]:
            curves.setdefault(p["method"], []).append((p["cpu_s"], p["error_rad"]))
    reached = [(t, m) for m, c in curves.items() if (t := _crossing(sorted(c), target))]
    return min(reached, default=None)


def _crossing(curve: list[tuple[float, float]], target: float) -> float | None:
    before: tuple[float, float] | None = None
    for cost, error in curve:
        if error <= target:
            return cost if before is None else _between(before, (cost, error), target)
        before = (cost, error)
    return None


def _between(a: tuple[float, float], b: tuple[float, float], target: float) -> float:
    part = math.log(a[1] / target) / math.log(a[1] / b[1])
    return a[0] * (b[0] / a[0]) ** part


def table(points: list[Record], ours: str) -> list[Record]:
    """One row for each robot, scenario, target and simulator, with the ratio to ours."""
    rows = []
    groups = dict.fromkeys((p["robot"], p["scenario"]) for p in points)
    families = dict.fromkeys(p["family"] for p in points)
    for robot, scenario in groups:
        here = [p for p in points if (p["robot"], p["scenario"]) == (robot, scenario)]
        for target in TARGETS:
            best = {f: cheapest((p for p in here if p["family"] == f), target) for f in families}
            mine = best.get(ours)
            for family, cheapest_run in best.items():
                rows.append(
                    {
                        "robot": robot,
                        "scenario": scenario,
                        "duration_s": here[0]["duration_s"],
                        "target_rad": target,
                        "family": family,
                        "method": cheapest_run[1] if cheapest_run else None,
                        "cpu_s": cheapest_run[0] if cheapest_run else None,
                        "ratio": cheapest_run[0] / mine[0] if cheapest_run and mine else None,
                    }
                )
    return rows
