# SPDX-License-Identifier: Apache-2.0
"""What this suite promises about speed and accuracy, held against what was just measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.comparison.targets import cheapest
from benchmarks.peers.base import OURS
from benchmarks.studies.bench import Record

KEPT, BROKEN = "kept", "broken"
TOO_NOISY, MISSING = "too noisy to judge", "not measured"
NOISY = 0.15  # of the probe's time, from its 10th to its 90th percentile
PANDA, FREE = "Panda", "free motion"
ADAPTIVE = "dop853, adaptive"


@dataclass(frozen=True)
class Claim:
    """One promise.

    Attributes:
        text: what is promised. limit: the largest value that keeps it.
        value: what was measured, None where a peer or a study is missing.
        unit: of both.
        between: quartiles of what was measured round by round, None where only one number was.
    """

    text: str
    value: float | None
    limit: float
    unit: str
    between: tuple[float, float] | None = None

    def verdict(self, noisy: bool) -> str:
        """Whether the promise holds in this run, or that this cannot be told.

        A time is judged only where the host does not decide: quartiles on both sides of the limit
        say nothing, and neither does a time above it while the same arithmetic took now this long
        and now that.
        """
        if self.value is None:
            return MISSING
        if self.unit != "rad":
            low, high = self.between or (self.value, self.value)
            if low <= self.limit < high or (noisy and high > self.limit):
                return TOO_NOISY
        return KEPT if self.value <= self.limit else BROKEN


def check(results: Record) -> list[Record]:
    """Every claim with its verdict, from the results of all studies that ran."""
    noisy = results.get("about", {}).get("noise", {}).get("spread_10_90", 0.0) > NOISY
    claims = [
        *_steps(results), *_errors(results), *_targets(results), *_rollouts(results),
        *_closed_chain(results), *_starts(results),
    ]  # fmt: skip
    return [asdict(c) | {"verdict": c.verdict(noisy)} for c in claims]


def _steps(results: Record) -> list[Claim]:
    rk4, aba = f"{OURS} rk4", "Pinocchio aba from C++"
    pairs = (
        ("RK4 step of Panda ÷ MuJoCo's Euler step", "step", rk4, "MuJoCo Euler", 0.75),
        ("RK4 step of Panda ÷ MuJoCo's RK4 step", "step", rk4, "MuJoCo RK4", 0.2),
        ("forward dynamics ÷ Pinocchio's aba from C++", "evaluation", OURS, aba, 0.4),
    )
    return [
        _paired(text, _row(results, what, mine), _row(results, what, theirs), limit)
        for text, what, mine, theirs, limit in pairs
    ]


def _paired(text: str, mine: Record | None, theirs: Record | None, limit: float) -> Claim:
    """A claim on a ratio, taken round by round, as a slow second slows both down."""
    if mine is None or theirs is None:
        return Claim(text, None, limit, "×")
    if not (mine.get("rounds_ns") and theirs.get("rounds_ns")):  # of an earlier report
        return Claim(text, _ratio(mine["ns"], theirs["ns"]), limit, "×")
    ratios = np.divide(mine["rounds_ns"], theirs["rounds_ns"])
    low, median, high = map(float, np.percentile(ratios, [25, 50, 75]))
    return Claim(text, median, limit, "×", (low, high))


def _errors(results: Record) -> list[Claim]:
    rk4 = _error(results, "rk4", 1e-3)
    controlled = _error(results, ADAPTIVE, 1e-9)
    return [
        Claim("RK4 at 1 ms, torque-free Panda, error after 1 s", rk4, 5e-6, "rad"),
        Claim("tolerance 1e-9 delivers, after 1 s", controlled, 1e-8, "rad"),
    ]


def _targets(results: Record) -> list[Claim]:
    points = results.get("work_precision", {}).get("points", [])
    here = [p for p in points if (p["robot"], p["scenario"]) == (PANDA, FREE)]

    def least(family: Callable[[str], bool], target: float) -> float | None:
        found = cheapest((p for p in here if family(p["family"])), target)
        return found[0] if found else None

    def against(peer: str, target: float) -> float | None:
        return _ratio(least(OURS.__eq__, target), least(peer.__eq__, target))

    fastest = _ratio(least(OURS.__eq__, 1e-9), least(OURS.__ne__, 1e-9))
    return [
        Claim("1 s of Panda to 2e-6 rad ÷ MuJoCo's best", against("MuJoCo", 2e-6), 1 / 12, "×"),
        Claim("1 s of Panda to 2e-6 rad ÷ Drake's best", against("Drake", 2e-6), 1 / 100, "×"),
        Claim("1 s of Panda to 1e-9 rad ÷ the fastest peer", fastest, 1.0, "×"),
    ]


def _rollouts(results: Record) -> list[Claim]:
    rows = [r for r in results.get("rollouts", {}).get("rows", []) if r["robot"] == PANDA]
    theirs = _best_rate(rows, "MuJoCo RK4")
    widest, narrow = _best_rate(rows, f"{OURS} rk4"), _best_rate(rows, f"{OURS} rk4, 256 bits")
    return [
        Claim("MuJoCo's RK4 arm-steps/s/core ÷ ours, widest vectors",
              _ratio(theirs, widest), 1 / 20, "×"),
        Claim("MuJoCo's RK4 arm-steps/s/core ÷ ours, 256 bits",
              _ratio(theirs, narrow), 1 / 15, "×"),
    ]  # fmt: skip


def _closed_chain(results: Record) -> list[Claim]:
    found = results.get("closed_chain", {})
    rows = found.get("rows", [])
    mine = [r for r in rows if r["who"].startswith(OURS)]
    theirs = [r for r in rows if not r["who"].startswith(OURS)]
    step = next((r["ns"] for r in mine if r["step"] == 1e-3), None)
    error = min((r["error"] for r in theirs), default=0.0)
    cheap = min((_second(r) for r in mine if r["error"] <= error), default=None)
    best = min((_second(r) for r in theirs if r["error"] <= 2.0 * error), default=None)
    four = 4.0 * found["pinocchio_ns"] if found else None
    return [
        Claim("RK4 step of a four-bar ÷ four of Pinocchio's constraintDynamics from C++",
              _ratio(step, four), 1.0, "×"),
        Claim("1 s of a four-bar to MuJoCo's least error ÷ MuJoCo", _ratio(cheap, best), 1.0, "×"),
    ]  # fmt: skip


def _second(row: Record) -> float:
    """What a simulated second takes, in [ns]."""
    return float(row["ns"] / row["step"])


def _starts(results: Record) -> list[Claim]:
    rows = results.get("startup", {}).get("rows", [])
    panda = next((r for r in rows if r["robot"] == PANDA), None)
    total = "total without imports"
    code = {r["joints"]: r["compiled_bytes"] for r in rows if "Chain" in r["robot"]}
    work = {r["joints"]: r["cold_s"]["processor"] - r["cached_s"]["processor"]
            for r in rows if "Chain" in r["robot"]}  # fmt: skip
    starts = {r["robot"]: r for r in rows}
    large = [
        Claim(f"{kind} start of {name}", starts.get(name, {}).get(key, {}).get(total), limit, "s")
        for name, cold, cached in (("TIAGo", 30.0, 15.0), ("TIAGo with two arms", 60.0, 30.0))
        for kind, key, limit in (("cold", "cold_s", cold), ("cached", "cached_s", cached))
    ]
    return [
        *large,
        Claim("cached start of Panda", panda and panda["cached_s"][total], 0.3, "s"),
        Claim("cold start of Panda", panda and panda["cold_s"][total], 5.0, "s"),
        Claim("compile time, 50 joints ÷ 10", _ratio(work.get(50), work.get(10)), 5.0, "×"),
        Claim("code size, 50 joints ÷ 10", _ratio(code.get(50), code.get(10)), 5.0, "×"),
    ]


def _row(results: Record, what: str, start: str) -> Record | None:
    rows = results.get("cost", {}).get("rows", [])
    mine = (r for r in rows if r["robot"] == PANDA and r["what"] == what)
    return next((r for r in mine if r["who"].startswith(start)), None)


def _error(results: Record, method: str, setting: float) -> float | None:
    for p in results.get("work_precision", {}).get("points", []):
        if (p["robot"], p["scenario"], p["family"]) == (PANDA, FREE, OURS) and (
            p["method"] == method and abs(p["setting"] / setting - 1) < 1e-9
        ):
            return p["error_rad"]
    return None


def _best_rate(rows: list[Record], who: str) -> float | None:
    return max((r["arm_steps_per_s_per_core"] for r in rows if r["who"] == who), default=None)


def _ratio(a: float | None, b: float | None) -> float | None:
    return a / b if a and b else None
