# SPDX-License-Identifier: Apache-2.0
"""What this suite claims about speed and accuracy, compared with the measurements of a run."""

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


# What was measured in each round of interleaved measurements, as a slow second slows a whole round
# down; None where there is nothing.
Rounds = Sequence[float | None] | None


def _timed(text: str, rounds: Rounds, limit: float, unit: str = "×") -> Claim:
    """A claim on times, whose value is the median over the rounds."""
    known = [x for x in rounds or () if x is not None]
    if not known:
        return Claim(text, None, limit, unit)
    return Claim(text, float(np.median(known)), limit, unit, of_median(known))


def _ratio(mine: Rounds, theirs: Rounds) -> Rounds:
    if mine is None or theirs is None:
        return None
    return [a / b if a and b else None for a, b in zip(mine, theirs, strict=False)]


def _least(rows: Sequence[Record], rounds: str) -> Rounds:
    """The least of some rows, round by round."""
    return [min(taken) for taken in zip(*(row[rounds] for row in rows), strict=True)] or None


def _rows(results: Record, study: str, **wanted: str) -> list[Record]:
    """Rows of a study whose entries begin so."""
    rows = results.get(study, {}).get("rows", [])
    return [r for r in rows if all(r[key].startswith(word) for key, word in wanted.items())]


def _steps(results: Record) -> list[Claim]:
    def cost(what: str, who: str) -> Rounds:
        return _least(_rows(results, "cost", robot=PANDA, what=what, who=who)[:1], "rounds_ns")

    rk4 = cost("step", f"{OURS} rk4")
    aba = cost("evaluation", "Pinocchio's ABA from C++")
    return [
        _timed("RK4 step of Panda ÷ MuJoCo's Euler step",
               _ratio(rk4, cost("step", "MuJoCo Euler")), 0.75),
        _timed("RK4 step of Panda ÷ MuJoCo's RK4 step",
               _ratio(rk4, cost("step", "MuJoCo RK4")), 0.2),
        _timed("forward dynamics ÷ Pinocchio's ABA from C++",
               _ratio(cost("evaluation", OURS), aba), 0.4),
    ]  # fmt: skip


def _points(results: Record) -> list[Record]:
    points = results.get("work_precision", {}).get("points", [])
    return [p for p in points if (p["robot"], p["scenario"]) == (PANDA, FREE)]


def _errors(results: Record) -> list[Claim]:
    def error(method: str, setting: float) -> float | None:
        return next((
            p["error_rad"] for p in _points(results)
            if (p["family"], p["method"]) == (OURS, method)
            and abs(p["setting"] / setting - 1) < 1e-9
        ), None)  # fmt: skip

    return [
        Claim("RK4 at 1 ms, torque-free Panda, error after 1 s", error("rk4", 1e-3), 5e-6, "rad"),
        Claim("tolerance 1e-9 delivers, after 1 s", error(ADAPTIVE, 1e-9), 1e-8, "rad"),
    ]


def _targets(results: Record) -> list[Claim]:
    here = _points(results)
    count = min((len(p["rounds_s"]) for p in here), default=0)

    def cost(family: Callable[[str], bool], target: float) -> Rounds:
        """Least time to an error."""
        mine = [p for p in here if family(p["family"])]
        each = [cheapest((p | {"cpu_s": p["rounds_s"][k]} for p in mine), target)
                for k in range(count)]  # fmt: skip
        return [one and one[0] for one in each]

    return [
        _timed(f"1 s of Panda to {target:g} rad ÷ {text}",
               _ratio(cost(OURS.__eq__, target), cost(whose, target)), limit)
        for target, text, whose, limit in (
            (2e-6, "MuJoCo's best", "MuJoCo".__eq__, 1 / 12),
            (2e-6, "Drake's best", "Drake".__eq__, 1 / 100),
            (1e-9, "the fastest peer", OURS.__ne__, 1.0),
        )
    ]  # fmt: skip


def _rollouts(results: Record) -> list[Claim]:
    def step(who: str) -> Rounds:
        rows = [r for r in _rows(results, "rollouts", robot=PANDA) if r["who"] == who]
        return _least(rows, "rounds_s_per_core")

    return [
        _timed(f"MuJoCo's RK4 arm-steps/s/core ÷ ours, {text}",
               _ratio(step(who), step("MuJoCo RK4")), limit)
        for text, who, limit in (
            ("widest vectors", f"{OURS} rk4", 1 / 20),
            ("256 bits", f"{OURS} rk4, 256 bits", 1 / 15),
        )
    ]  # fmt: skip


def _closed_chain(results: Record) -> list[Claim]:
    study = results.get("closed_chain", {})
    rows = [r | {"rounds": [ns / r["step"] for ns in r["rounds_ns"]]}
            for r in study.get("rows", [])]  # fmt: skip
    mine = [r for r in rows if r["who"].startswith(OURS)]
    theirs = [r for r in rows if not r["who"].startswith(OURS)]
    error = min((r["error"] for r in theirs), default=0.0)
    fours = [4.0 * ns for ns in study.get("pinocchio_rounds_ns", ())]
    step = _least([r for r in mine if r["step"] == 1e-3], "rounds_ns")
    cheap = _least([r for r in mine if r["error"] <= error], "rounds")
    best = _least([r for r in theirs if r["error"] <= 2.0 * error], "rounds")
    return [
        _timed("RK4 step of a four-bar ÷ four of Pinocchio's constraintDynamics from C++",
               _ratio(step, fours), 1.0),
        _timed("1 s of a four-bar to MuJoCo's least error ÷ MuJoCo", _ratio(cheap, best), 1.0),
    ]  # fmt: skip


def _starts(results: Record) -> list[Claim]:
    starts = {r["robot"]: r for r in reversed(_rows(results, "startup"))}

    def start(name: str, kind: str, limit: float) -> Claim:
        rounds = starts[name][f"{kind}_rounds_s"] if name in starts else None
        return _timed(f"{kind} start of {name}", rounds, limit, "s")

    compiling = [
        starts[chain]["cold_s"]["processor"] - starts[chain]["cached_s"]["processor"]
        for chain in ("Chain 50", "Chain 10") if chain in starts
    ]  # fmt: skip
    growth = [compiling[0] / compiling[1]] if len(compiling) == 2 else None
    return [
        start("TIAGo", "cold", 30.0), start("TIAGo", "cached", 15.0),
        start(PANDA, "cached", 0.3), start(PANDA, "cold", 5.0),
        _timed("compile time, 50 joints ÷ 10", growth, 5.0),
    ]  # fmt: skip
