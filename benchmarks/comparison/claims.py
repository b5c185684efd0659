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


# A value, and the same in each round of interleaved measurements. Ratios are taken round by round,
# as a slow second slows both sides down; None where there is none.
Rounds = Sequence[float | None]
Measured = tuple[float, Rounds] | None


def _timed(text: str, measured: Measured, limit: float, unit: str = "×") -> Claim:
    """A claim on times, whose value is the median over the rounds."""
    if measured is None:
        return Claim(text, None, limit, unit)
    value, given = measured
    rounds = [x for x in given if x is not None]
    return Claim(text, float(np.median(rounds or value)), limit, unit, of_median(rounds))


def _ratio(mine: Measured, theirs: Measured) -> Measured:
    if mine is None or theirs is None:
        return None
    pairs = zip(mine[1], theirs[1], strict=False)
    return mine[0] / theirs[0], [a / b if a and b else None for a, b in pairs]


def _least(rows: Sequence[Record], key: str, rounds: str) -> Measured:
    """The least of some rows, in all and round by round."""
    if not rows:
        return None
    each = zip(*(row.get(rounds, ()) for row in rows), strict=True)
    return min(row[key] for row in rows), [min(taken) for taken in each]


def _rows(results: Record, study: str, **wanted: str) -> list[Record]:
    """Rows of a study whose entries begin so."""
    rows = results.get(study, {}).get("rows", [])
    return [r for r in rows if all(r[key].startswith(word) for key, word in wanted.items())]


def _steps(results: Record) -> list[Claim]:
    def cost(what: str, who: str) -> Measured:
        rows = _rows(results, "cost", robot=PANDA, what=what, who=who)
        return _least(rows[:1], "ns", "rounds_ns")

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
    count = min((len(p.get("rounds_s", ())) for p in here), default=0)

    def cost(family: Callable[[str], bool], target: float) -> Measured:
        """Least time to an error, in all rounds and in each."""
        mine = [p for p in here if family(p["family"])]
        each = [cheapest((p | {"cpu_s": p["rounds_s"][k]} for p in mine), target)
                for k in range(count)]  # fmt: skip
        least = cheapest(mine, target)
        return least and (least[0], [one and one[0] for one in each])

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
    def step(who: str) -> Measured:
        rows = [
            r | {"step": 1.0 / r["arm_steps_per_s_per_core"]}
            for r in _rows(results, "rollouts", robot=PANDA) if r["who"] == who
        ]  # fmt: skip
        return _least(rows, "step", "rounds_s_per_core")

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
    rows = [
        r | {"second": r["ns"] / r["step"],
             "rounds": [ns / r["step"] for ns in r.get("rounds_ns", ())]}
        for r in study.get("rows", [])
    ]  # fmt: skip
    mine = [r for r in rows if r["who"].startswith(OURS)]
    theirs = [r for r in rows if not r["who"].startswith(OURS)]
    error = min((r["error"] for r in theirs), default=0.0)
    fours = [4.0 * ns for ns in study.get("pinocchio_rounds_ns", ())]
    step = _least([r for r in mine if r["step"] == 1e-3], "ns", "rounds_ns")
    cheap = _least([r for r in mine if r["error"] <= error], "second", "rounds")
    best = _least([r for r in theirs if r["error"] <= 2.0 * error], "second", "rounds")
    return [
        _timed("RK4 step of a four-bar ÷ four of Pinocchio's constraintDynamics from C++",
               _ratio(step, (4.0 * study["pinocchio_ns"], fours) if study else None), 1.0),
        _timed("1 s of a four-bar to MuJoCo's least error ÷ MuJoCo", _ratio(cheap, best), 1.0),
    ]  # fmt: skip


def _starts(results: Record) -> list[Claim]:
    rows = _rows(results, "startup")
    chains = {r["joints"]: r for r in rows if "Chain" in r["robot"]}
    starts = {r["robot"]: r for r in reversed(rows)}

    def start(name: str, kind: str, limit: float) -> Claim:
        row = starts.get(name)
        value = row and (row[f"{kind}_s"]["total without imports"],
                         row.get(f"{kind}_rounds_s", ()))  # fmt: skip
        return _timed(f"{kind} start of {name}", value, limit, "s")

    def growth(of: Callable[[Record], float]) -> float | None:
        return of(chains[50]) / of(chains[10]) if {10, 50} <= chains.keys() else None

    compiling = growth(lambda r: r["cold_s"]["processor"] - r["cached_s"]["processor"])
    code = growth(lambda r: r["compiled_bytes"])
    return [
        start("TIAGo", "cold", 30.0), start("TIAGo", "cached", 15.0),
        start("TIAGo with two arms", "cold", 60.0), start("TIAGo with two arms", "cached", 30.0),
        start(PANDA, "cached", 0.3), start(PANDA, "cold", 5.0),
        _timed("compile time, 50 joints ÷ 10", compiling and (compiling, ()), 5.0),
        Claim("code size, 50 joints ÷ 10", code, 5.0, "×"),
    ]  # fmt: skip
