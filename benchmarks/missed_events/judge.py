# SPDX-License-Identifier: Apache-2.0
"""One run against two truths, and what it says of itself.

The truths are the motion of ticks a hundred times shorter, and where it can and is asked, that of
a simulator which shares no line with the suite.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics import ArmError
from arm_sim import Recording, Simulator
from benchmarks.missed_events.blind import switched_off
from benchmarks.missed_events.cases import Case, draw
from benchmarks.missed_events.second_truth import solve

FINER, FINE_TOLERANCE = 100, 1e-11
NUDGE, STEADY = 1e-9, 1e4  # a start moved by so much moves the end by at most so many times more
FACTOR, FIXED = 10.0, 1e-6  # error allowed, in tolerances; and without error control
BESIDE = 3.0  # times the stated error that tells of one
RIGHT, SHOWN, UNSTEADY, REFUSED, MISSED = "right", "shown", "not steady", "refused", "missed"
MAGNIFIED, SAME = "magnified", "the same"
OUTCOMES = (RIGHT, SHOWN, MISSED, MAGNIFIED, UNSTEADY, REFUSED, SAME)


@dataclass(frozen=True)
class Result:
    """What became of one run.

    Attributes:
        seed: of the case.
        label: its features.
        way: method, tick and tolerance.
        outcome: one of ``OUTCOMES``; ``magnified`` if the error is allowed at the beginning and
            the motion itself makes it too large later, ``the same`` if the guard that was
            switched off had nothing to see.
        error: largest error of q, relative to 1 + |q|, against either truth.
        allowed: error that needs no word.
        growth: error at the end over a nudge of the start, at least 1.
        apart: difference of the two truths; NaN without the second.
        alone: why there is no second truth.
        told: what told of an error.
        blind: the guard that was switched off.
    """

    seed: int
    label: str
    way: str
    outcome: str
    error: float = np.nan
    allowed: float = np.nan
    growth: float = np.nan
    apart: float = np.nan
    alone: str = ""
    told: str = ""
    blind: str = ""


def examine(seed: int, blinded: bool = False, share: float = 0.0) -> Result:
    """Run a case.

    Args:
        seed: of the case.
        blinded: whether one of the engine's guards is switched off.
        share: of the cases in which the second truth is asked, too.
    """
    case = draw(seed)
    blind = switched_off(seed, case.label) if blinded else nullcontext("")
    try:
        with blind as name:
            sim, start, run = _made(case)
        if blinded and np.array_equal(_made(case)[2].x, run.x):
            return Result(seed, case.label, f"{case.method}", SAME, blind=name)
    except ArmError as error:
        return Result(seed, case.label, f"{case.method}", REFUSED, told=f"{error}"[:160])
    choice = sim.choice
    way = f"{choice.method.name} {choice.dt:.2g} s" + (
        "" if choice.tolerance is None else f", tolerance {choice.tolerance:.1g}"
    )
    found = Result(seed, case.label, way, UNSTEADY, blind=name)
    if (truth := _truth(case, start)) is None:
        return found
    asked = np.random.default_rng([seed, 1]).random() < share
    second = solve(case, start) if asked else "not asked"
    return _judged(found, run, choice.tolerance, truth, second)


def _judged(
    found: Result, run: Recording, tolerance: float | None, truth: tuple[np.ndarray, float],
    second: np.ndarray | str,
) -> Result:  # fmt: skip
    true, growth = truth
    alone = second if isinstance(second, str) else ""
    apart = np.nan if isinstance(second, str) else _error(second, true)
    error = _error(run.q, true)
    if apart > NUDGE * growth:  # else rounding
        error = max(error, _error(run.q, np.asarray(second)))
    allowed = FIXED if tolerance is None else max(FACTOR * tolerance, 1e-12)
    told = run.doubt or ("stated error" if error <= BESIDE * np.max(run.error) else "")
    outcome = RIGHT if error <= allowed else SHOWN if told else MISSED
    if outcome == MISSED and error <= growth * allowed:
        outcome = MAGNIFIED
    return replace(
        found, outcome=outcome, error=error, allowed=allowed, growth=growth, apart=apart,
        alone=alone, told=told,
    )  # fmt: skip


def _error(q: np.ndarray, true: np.ndarray) -> float:
    return float(np.max(abs(q - true) / (1 + abs(true))))


def _made(case: Case) -> tuple[Simulator, tuple[np.ndarray, np.ndarray], Recording]:
    """The simulator of a case, the start, and the run."""
    sim = Simulator(case.scene, case.method, case.dt, case.tolerance)
    start = _started(sim, case)
    return sim, start, sim.run(len(case.command) * case.dt, case.command)


def _started(sim: Simulator, case: Case) -> tuple[np.ndarray, np.ndarray]:
    try:
        state = sim.reset(case.q, case.v)
    except ArmError:
        state = sim.reset(None, case.v)
    return np.array(state.q), np.array(state.v)


def _truth(case: Case, start: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, float] | None:
    """Positions at every tick, and the growth of a nudge of the start; None if it is large."""
    q, v = start
    fine = Simulator(case.scene, "dop853", case.dt / FINER, FINE_TOLERANCE)
    sign = np.where(np.arange(len(q)) % 2, 1.0, -1.0)
    ends = []
    for nudge in (0.0, NUDGE, -NUDGE):
        try:
            fine.reset(q + nudge * sign, v - nudge * sign)
            ends.append(fine.run(len(case.command) * case.dt, np.repeat(case.command, FINER, 0)))
        except ArmError:
            return None
    true = np.asarray(ends[0].q[::FINER])
    moved = max(float(np.max(abs(end.q[::FINER] - true))) for end in ends[1:])
    if moved > STEADY * NUDGE or ends[0].time_stepped[-1]:
        return None
    return true, max(1.0, moved / NUDGE)
