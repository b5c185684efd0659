# SPDX-License-Identifier: Apache-2.0
"""What an error costs: the cheapest way of each simulator to reach it."""

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
    last = 0.0, math.inf
    for cost, error in curve:
        if error <= target:
            if not last[0]:
                return cost
            part = math.log(last[1] / target) / math.log(last[1] / error)
            return last[0] * (cost / last[0]) ** part
        last = cost, error
    return None


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
            for family, run in best.items():
                cpu_s, method = run or (None, None)
                rows.append({
                    "robot": robot, "scenario": scenario, "duration_s": here[0]["duration_s"],
                    "target_rad": target, "family": family, "method": method, "cpu_s": cpu_s,
                    "ratio": cpu_s / mine[0] if cpu_s and mine else None,
                })  # fmt: skip
    return rows
