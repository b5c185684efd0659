# SPDX-License-Identifier: Apache-2.0
"""What this suite claims about speed and accuracy, compared with the measurements of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.comparison.targets import cheapest
from benchmarks.measurement.intervals import of_median
from benchmarks.peers.base import OURS
from benchmarks.studies.bench import Record

MET, MISSED, OPEN, MISSING = "met", "missed", "open", "not measured"
PANDA, FREE = "Panda", "free motion"
ADAPTIVE = "dop853, adaptive"


@dataclass(frozen=True)
class Claim:
    """One claim."""

    text: str
    value: float | None  # what was measured, None where a peer or a study is missing
    limit: float  # the largest value that meets it
    unit: str  # of both
    # confidence interval of the value; None for values that are the same in every run
    between: tuple[float, float] | None = None

    @property
    def verdict(self) -> str:
        """Met or missed if the whole interval is on one side of the limit, else open."""
        if self.value is None:
            return MISSING
        low, high = self.between or (self.value, self.value)
        if high <= self.limit:
            return MET
        return MISSED if low > self.limit else OPEN


def check(results: Record) -> list[Record]:
    """Every claim with its verdict, from the results of all studies that ran."""
    claims = [
        *_steps(results), *_errors(results), *_targets(results), *_rollouts(results),
        *_closed_chain(results), *_starts(results),
    ]  # fmt: skip
    return [asdict(c) | {"verdict": c.verdict} for c in claims]


# A number for each round of interleaved measurements. Ratios are taken round by round, as a slow
# second slows both sides down.
Rounds = Sequence[float]


def _timed(text: str, value: float | None, rounds: Rounds, limit: float, unit: str = "×") -> Claim:
    """A claim on times, whose value is the median over the rounds."""
    if value is None:
        return Claim(text, None, limit, unit)
    if rounds:
        value = float(np.median(rounds))
    return Claim(text, value, limit, unit, of_median(rounds))


def _ratios(mine: Rounds, theirs: Rounds) -> Rounds:
    return [a / b for a, b in zip(mine, theirs, strict=True)] if mine and theirs else ()


def _per_round(rows: Sequence[Record], key: str, best: Callable[..., float]) -> Rounds:
    """The best of some rows, round by round."""
    if not rows or not all(key in row for row in rows):
        return ()
    return [best(taken) for taken in zip(*(row[key] for row in rows), strict=True)]


def _steps(results: Record) -> list[Claim]:
    rk4, aba = f"{OURS} rk4", "Pinocchio's ABA from C++"
    pairs = (
        ("RK4 step of Panda ÷ MuJoCo's Euler step", "step", rk4, "MuJoCo Euler", 0.75),
        ("RK4 step of Panda ÷ MuJoCo's RK4 step", "step", rk4, "MuJoCo RK4", 0.2),
        ("forward dynamics ÷ Pinocchio's ABA from C++", "evaluation", OURS, aba, 0.4),
    )
    return [
        _paired(text, _row(results, what, mine), _row(results, what, theirs), limit)
        for text, what, mine, theirs, limit in pairs
    ]


def _paired(text: str, mine: Record | None, theirs: Record | None, limit: float) -> Claim:
    if mine is None or theirs is None:
        return Claim(text, None, limit, "×")
    ratios = _ratios(mine.get("rounds_ns", ()), theirs.get("rounds_ns", ()))
    return _timed(text, _ratio(mine["ns"], theirs["ns"]), ratios, limit)


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

    def least(family: Callable[[str], bool], target: float, k: int | None = None) -> float | None:
        """Least time to an error, in all rounds or in one."""
        least_cost = cheapest((_in_round(p, k) for p in here if family(p["family"])), target)
        return least_cost[0] if least_cost else None

    def against(text: str, whose: Callable[[str], bool], target: float, limit: float) -> Claim:
        def ratio(k: int | None = None) -> float | None:
            return _ratio(least(OURS.__eq__, target, k), least(whose, target, k))

        count = min((len(p.get("rounds_s", ())) for p in here), default=0)
        rounds = [r for k in range(count) if (r := ratio(k)) is not None]
        return _timed(text, ratio(), rounds, limit)

    return [
        against("1 s of Panda to 2e-6 rad ÷ MuJoCo's best", "MuJoCo".__eq__, 2e-6, 1 / 12),
        against("1 s of Panda to 2e-6 rad ÷ Drake's best", "Drake".__eq__, 2e-6, 1 / 100),
        against("1 s of Panda to 1e-9 rad ÷ the fastest peer", OURS.__ne__, 1e-9, 1.0),
    ]


def _in_round(point: Record, k: int | None) -> Record:
    return point if k is None else point | {"cpu_s": point["rounds_s"][k]}


def _rollouts(results: Record) -> list[Claim]:
    rows = [r for r in results.get("rollouts", {}).get("rows", []) if r["robot"] == PANDA]

    def least(who: str) -> Rounds:
        return _per_round([r for r in rows if r["who"] == who], "rounds_s_per_core", min)

    peer = "MuJoCo RK4"
    return [
        _timed(
            f"MuJoCo's RK4 arm-steps/s/core ÷ ours, {text}",
            _ratio(_best_rate(rows, peer), _best_rate(rows, who)),
            _ratios(least(who), least(peer)), limit,
        )
        for text, who, limit in (
            ("widest vectors", f"{OURS} rk4", 1 / 20),
            ("256 bits", f"{OURS} rk4, 256 bits", 1 / 15),
        )
    ]  # fmt: skip


def _closed_chain(results: Record) -> list[Claim]:
    study = results.get("closed_chain", {})
    rows = study.get("rows", [])
    mine = [r for r in rows if r["who"].startswith(OURS)]
    theirs = [r for r in rows if not r["who"].startswith(OURS)]
    step = next((r for r in mine if r["step"] == 1e-3), {})
    error = min((r["error"] for r in theirs), default=0.0)
    cheap = [r for r in mine if r["error"] <= error]
    best = [r for r in theirs if r["error"] <= 2.0 * error]
    four = 4.0 * study["pinocchio_ns"] if study else None
    fours = [4.0 * ns for ns in study.get("pinocchio_rounds_ns", ())]
    return [
        _timed("RK4 step of a four-bar ÷ four of Pinocchio's constraintDynamics from C++",
               _ratio(step.get("ns"), four), _ratios(step.get("rounds_ns", ()), fours), 1.0),
        _timed("1 s of a four-bar to MuJoCo's least error ÷ MuJoCo",
               _ratio(_least_second(cheap), _least_second(best)),
               _ratios(_seconds(cheap), _seconds(best)), 1.0),
    ]  # fmt: skip


def _least_second(rows: Sequence[Record]) -> float | None:
    return min(map(_second, rows), default=None)


def _seconds(rows: Sequence[Record]) -> Rounds:
    """What a simulated second takes in the best row, round by round, in [ns]."""
    scaled = [
        {"rounds": [ns / r["step"] for ns in r["rounds_ns"]]} for r in rows if "rounds_ns" in r
    ]
    return _per_round(scaled, "rounds", min)


def _second(row: Record) -> float:
    """What a simulated second takes, in [ns]."""
    return float(row["ns"] / row["step"])


def _starts(results: Record) -> list[Claim]:
    rows = results.get("startup", {}).get("rows", [])
    total = "total without imports"
    code = {r["joints"]: r["compiled_bytes"] for r in rows if "Chain" in r["robot"]}
    work = {r["joints"]: r["cold_s"]["processor"] - r["cached_s"]["processor"]
            for r in rows if "Chain" in r["robot"]}  # fmt: skip
    starts = {r["robot"]: r for r in reversed(rows)}

    def start(name: str, kind: str, limit: float) -> Claim:
        row = starts.get(name, {})
        rounds = row.get(f"{kind}_rounds_s", ())
        return _timed(f"{kind} start of {name}", row.get(f"{kind}_s", {}).get(total), rounds,
                      limit, "s")  # fmt: skip

    return [
        start("TIAGo", "cold", 30.0), start("TIAGo", "cached", 15.0),
        start("TIAGo with two arms", "cold", 60.0), start("TIAGo with two arms", "cached", 30.0),
        start(PANDA, "cached", 0.3), start(PANDA, "cold", 5.0),
        _timed("compile time, 50 joints ÷ 10", _ratio(work.get(50), work.get(10)), (), 5.0),
        Claim("code size, 50 joints ÷ 10", _ratio(code.get(50), code.get(10)), 5.0, "×"),
    ]  # fmt: skip


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
