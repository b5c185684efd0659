# SPDX-License-Identifier: Apache-2.0
"""Runs of every method, step and tolerance, and what follows from them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators import METHODS
from benchmarks.accuracy.problems import Problem

Row = dict[str, Any]
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
CONTROLLED = ("dopri5", "dop853")
TICKS = (1e-3, 0.1)  # [s]
CHUNK = 100.0  # [s]; a run records every tick
LOST = 10.0  # an error of this size says no more than that the motion is another one
CEILING = 1e-2  # orders are read below this error ...
FLOOR = 30.0  # ... and above this many times the smallest error that was reached, ...
DIGITS = 3e-14  # ... or this many revolutions' worth of rounding


def fixed(problem: Problem) -> Iterator[Row]:
    """The error of each method at each step."""
    for method in METHODS:
        for step in problem.steps:
            sim = Simulator(problem.scene, integrator=method, dt=step)
            yield {
                "problem": problem.name,
                "method": method,
                "step_s": step,
                "error": _error(problem, sim)[0],
            }


def controlled(problem: Problem) -> Iterator[Row]:
    """The error at each tolerance, and what the simulator itself took it for."""
    for method in (*CONTROLLED, *(["implicit"] if problem.gated == "implicit" else [])):
        for tick in TICKS:
            for tolerance in TOLERANCES:
                sim = Simulator(problem.scene, integrator=method, dt=tick, tolerance=tolerance)
                error, estimate = _error(problem, sim)
                yield {
                    "problem": problem.name,
                    "method": method,
                    "tick_s": tick,
                    "tolerance": tolerance,
                    "error": error,
                    "estimate": estimate,
                }


def orders(problem: Problem, rows: list[Row]) -> list[Row]:
    """Slopes of error over step, where neither chaos nor rounding has the say."""
    here = [r for r in rows if r["problem"] == problem.name and r["error"]]
    floor = max(DIGITS * problem.duration, FLOOR * min(r["error"] for r in here))
    found = []
    for method in METHODS:
        line = [r for r in here if r["method"] == method and floor < r["error"] < CEILING][-3:]
        if len(line) >= 2:
            error, step = (np.log([r[key] for r in line]) for key in ("error", "step_s"))
            slope = float(np.polyfit(step, error, 1)[0])
            found.append({"problem": problem.name, "method": method, "order": slope})
    return found


def gate(problem: Problem, rows: list[Row]) -> Row:
    """The gated run against its gate."""
    error = next(
        r["error"]
        for r in rows
        if (r["problem"], r["method"], r["step_s"]) == (problem.name, problem.gated, 1e-3)
    )
    kept = error is not None and error <= problem.gate
    return {
        "what": f"{problem.name}, {problem.gated} at 1 ms, {problem.duration:g} s",
        "measured": error,
        "allowed": problem.gate,
        "kept": kept,
    }


def _error(problem: Problem, sim: Simulator) -> tuple[float | None, float]:
    """Largest error over all times, and the simulator's own estimate; None if it diverged."""
    if problem.start is not None:
        sim.reset(*problem.start)
    worst = 0.0
    try:
        for time, wanted in sorted(problem.expected.items()):
            _advance(sim, time)
            worst = max(worst, float(np.abs(problem.observe(sim.state.q) - wanted).max()))
    except SimulationDiverged:
        return None, sim.state.error
    return (worst if worst < LOST else None), sim.state.error


def _advance(sim: Simulator, time: float) -> None:
    while (left := time - sim.state.time) > 0.5 * sim.dt:
        sim.run(min(left, CHUNK))
