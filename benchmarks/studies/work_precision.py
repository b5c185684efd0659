# SPDX-License-Identifier: Apache-2.0
"""Processor time against error in q, in free motion and under computed torque."""

from functools import partial

import numpy as np

from benchmarks.measurement.timing import Cost, Job, steady
from benchmarks.peers.base import TICK, Contestant
from benchmarks.reference import solution
from benchmarks.reference.closed_loop import Loop
from benchmarks.robots.models import Robot
from benchmarks.studies.bench import Bench, Record

FREE, CONTROLLED = "free motion", "computed torque at 1 kHz"
HOPELESS = 10.0  # [rad], an error beyond which a point is not drawn


def run(bench: Bench) -> Record:
    """Measure every contestant at every setting on every robot."""
    points: list[Record] = []
    truths: list[Record] = []
    for robot in bench.robots():
        loop = Loop(robot, ticks=1000 if bench.quick else 2000)
        free = partial(solution.free_motion, robot)
        held = partial(solution.closed_loop, robot, loop)
        cases = (FREE, robot.duration, free, None), (CONTROLLED, loop.ticks * TICK, held, loop)
        for scenario, duration, solve, closed in cases:
            about = {"robot": robot.name, "scenario": scenario, "duration_s": duration}
            bench.progress.stage(f"truth: {robot.name}, {scenario}", 1)
            truth = solve()
            truths.append(about | {"halving_rad": truth.halving, "other_method_rad": truth.other})
            points += _points(bench, robot, about, truth.q, closed)
    return {"truth": truths, "points": points}


def _points(
    bench: Bench, robot: Robot, about: Record, truth: np.ndarray, loop: Loop | None
) -> list[Record]:
    """Error and time of each contestant and setting, in free motion or in the loop."""
    jobs: dict[tuple[int, float], Job] = {}
    errors: dict[tuple[int, float], float] = {}
    cases = [
        (i, setting)
        for i, who in enumerate(bench.contestants)
        for setting in bench.thinned(who.tick_settings if loop else who.settings)
    ]
    label = f"{robot.name}, {about['scenario']}"
    for i, setting in bench.each(f"errors: {label}", cases):
        trial = bench.contestants[i].build(robot, setting)
        if loop:
            q, torques = loop.run(trial)
            move = partial(trial.replay, torques)
        else:
            trial.reset(robot.q0, np.zeros(robot.n))
            trial.advance(robot.duration)
            q, move = trial.state()[0], partial(trial.advance, robot.duration)
        errors[i, setting] = float(np.abs(q - truth).max())
        jobs[i, setting] = steady(partial(trial.reset, robot.q0, np.zeros(robot.n)), move)
    costs = bench.time(f"time: {label}", jobs)
    return [_point(about, bench.contestants[i], s, errors[i, s], costs[i, s]) for i, s in jobs]


def _point(about: Record, who: Contestant, setting: float, error: float, cost: Cost) -> Record:
    return about | {
        "family": who.family,
        "method": who.method,
        "knob": who.knob,
        "setting": setting,
        "error_rad": error if error < HOPELESS else None,
        "cpu_s": cost.median,
        "cpu_low_s": cost.low,
        "cpu_high_s": cost.high,
        "rounds_s": list(cost.samples),
    }
