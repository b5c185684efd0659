# SPDX-License-Identifier: Apache-2.0
"""One run against the motion of ticks a hundred times shorter, and what it says of itself."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from arm_dynamics import ArmError
from arm_sim import Recording, Simulator
from benchmarks.missed_events.blind import switched_off
from benchmarks.missed_events.cases import Case, draw

FINER, FINE_TOLERANCE = 100, 1e-11
NUDGE, STEADY = 1e-9, 1e4  # a start moved by so much moves the end by at most so many times more
FACTOR, FIXED = 10.0, 1e-6  # error allowed, in tolerances; and without error control
RIGHT, SHOWN, UNSTEADY, REFUSED, MISSED = "right", "shown", "not steady", "refused", "missed"
OUTCOMES = (RIGHT, SHOWN, MISSED, UNSTEADY, REFUSED)


@dataclass(frozen=True)
class Result:
    """What became of one run.

    Attributes:
        seed: of the case.
        label: its features.
        way: method, tick and tolerance.
        outcome: one of ``OUTCOMES``.
        error: largest error of q, relative to 1 + |q|.
        allowed: error that needs no word.
        told: what told of an error.
        blind: the guard that was switched off.
    """

    seed: int
    label: str
    way: str
    outcome: str
    error: float = np.nan
    allowed: float = np.nan
    told: str = ""
    blind: str = ""


def examine(seed: int, blinded: bool = False) -> Result:
    """Run a case."""
    case = draw(seed)
    blind = switched_off(seed) if blinded else nullcontext("")
    try:
        with blind as name:
            sim = Simulator(case.scene, case.method, case.dt, case.tolerance)
            start = _started(sim, case)
            run = sim.run(len(case.command) * case.dt, case.command)
    except ArmError as error:
        return Result(seed, case.label, f"{case.method}", REFUSED, told=f"{error}"[:160])
    choice = sim.choice
    way = f"{choice.method.name} {choice.dt:.2g} s" + (
        "" if choice.tolerance is None else f", tolerance {choice.tolerance:.1g}"
    )
    found = Result(seed, case.label, way, UNSTEADY, blind=name)
    if (true := _truth(case, start)) is None:
        return found
    error = float(np.max(abs(run.q - true) / (1 + abs(true))))
    allowed = FIXED if choice.tolerance is None else max(FACTOR * choice.tolerance, 1e-12)
    told = "; ".join(_told(run, error, controlled=choice.tolerance is not None))
    outcome = RIGHT if error <= allowed else SHOWN if told else MISSED
    return Result(seed, case.label, way, outcome, error, allowed, told, name)


def _told(run: Recording, error: float, controlled: bool) -> Iterator[str]:
    if run.energy_error > 1e-3:
        yield "energy account"
    if run.doubt:
        yield "second look"
    if run.time_stepped[-1]:
        yield "time-stepped"
    stated = run.error[-1] if controlled else 0.0
    if FACTOR * max(stated, run.second_look.error) >= error:
        yield "stated error"


def _started(sim: Simulator, case: Case) -> tuple[np.ndarray, np.ndarray]:
    try:
        state = sim.reset(case.q, case.v)
    except ArmError:
        state = sim.reset(None, case.v)
    return np.array(state.q), np.array(state.v)


def _truth(case: Case, start: tuple[np.ndarray, np.ndarray]) -> np.ndarray | None:
    """Positions at every tick; None where a nudge of the start changes the end a lot."""
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
    return true if moved <= STEADY * NUDGE and not ends[0].time_stepped[-1] else None
