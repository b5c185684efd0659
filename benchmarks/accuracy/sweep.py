# SPDX-License-Identifier: Apache-2.0
"""Runs of every method, step and tolerance, and what follows from them."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from arm_sim import SimulationDiverged, Simulator
from arm_sim.integrators.methods import METHODS
from benchmarks.accuracy.problems import Problem

Row = dict[str, Any]
TOLERANCES = tuple(float(f"1e-{k}") for k in range(3, 13))
CONTROLLED = tuple(method.name for method in METHODS.values() if method.adaptive)
CHUNK = 100.0  # [s]; a run records every tick
LOST = 10.0  # an error of this size says no more than that the motion is another one
CEILING = 0.1  # orders are read below this error ...
FLOOR = 10.0  # ... and above this many times what rounding leaves at the smallest step


def fixed(problem: Problem) -> Iterator[Row]:
    for method, step in product(METHODS, problem.steps):
        error = _error(problem, Simulator(problem.scene, integrator=method, dt=step))
        yield {"problem": problem.name, "method": method, "step_s": step, "error": error}


def controlled(problem: Problem) -> Iterator[Row]:
    for method, tick, tolerance in product(CONTROLLED, problem.ticks, TOLERANCES):
        sim = Simulator(problem.scene, integrator=method, dt=tick, tolerance=tolerance)
        yield {
            "problem": problem.name,
            "method": method,
            "tick_s": tick,
            "tolerance": tolerance,
            "error": _error(problem, sim),
        }


def orders(problem: Problem, rows: list[Row]) -> list[Row]:
    """Slopes of error over step, where neither chaos nor rounding has the say."""
    here = [r for r in rows if r["problem"] == problem.name and r["error"]]
    smallest = {r["method"]: r["error"] for r in here if r["step_s"] == problem.steps[-1]}
    rounding = max((e for m, e in smallest.items() if METHODS[m].order > 4), default=0.0)
    slopes = []
    for method in METHODS:
        own = smallest.get(method, 0.0) if method == "implicit" else 0.0  # it rounds more coarsely
        floor = FLOOR * max(rounding, own)
        line = [r for r in here if r["method"] == method and floor < r["error"] < CEILING][-3:]
        if len(line) >= 2:
            error, step = (np.log([r[key] for r in line]) for key in ("error", "step_s"))
            slope = float(np.polyfit(step, error, 1)[0])
            slopes.append({"problem": problem.name, "method": method, "order": slope})
    return slopes


def _error(problem: Problem, sim: Simulator) -> float | None:
    """Largest error over all times; None if it diverged."""
    if problem.start is not None:
        sim.reset(*problem.start)
    worst = 0.0
    try:
        for time, wanted in sorted(problem.expected.items()):
            _advance(sim, time)
            worst = max(worst, float(np.abs(problem.observe(sim.state.q) - wanted).max()))
    except SimulationDiverged:
        return None
    return worst if worst < LOST else None


def _advance(sim: Simulator, time: float) -> None:
    while (left := time - sim.state.time) > 0.5 * sim.dt:
        sim.run(min(left, CHUNK))
