# SPDX-License-Identifier: Apache-2.0
"""Processor time against error in q, in free motion and under computed torque."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.measurement.timing import Cost, Job, steady
from benchmarks.peers.base import Contestant, Trial
from benchmarks.reference import solution
from benchmarks.reference.closed_loop import Loop
from benchmarks.robots.models import Robot
from benchmarks.studies.bench import Bench, Record

SCENARIOS = ("free motion", "computed torque at 1 kHz")
HOPELESS = 10.0  # [rad], an error beyond which a point is not drawn


def run(bench: Bench) -> Record:
    """Measure every contestant at every setting on every robot."""
    points: list[Record] = []
    truths: list[Record] = []
    for robot in bench.robots():
        for measure in (_free, _closed):
            reference, found = measure(bench, robot)
            truths.append(reference)
            points += found
    return {"truth": truths, "points": points}


def _free(bench: Bench, robot: Robot) -> tuple[Record, list[Record]]:
    reference = bench.once(f"truth: {robot.name}, free", lambda: solution.free_motion(robot))
    jobs: dict[tuple[int, float], Job] = {}
    errors: dict[tuple[int, float], float] = {}
    still = np.zeros(robot.n)
    cases = _cases(bench, lambda who: who.settings)
    for i, setting in bench.each(f"errors: {robot.name}, free", cases):
        trial = bench.contestants[i].build(robot, setting)
        trial.reset(robot.q0, still)
        trial.advance(robot.duration)
        errors[i, setting] = _error(trial.state()[0], reference.q)
        jobs[i, setting] = _free_job(trial, robot)
    costs = bench.time(f"time: {robot.name}, free", jobs)
    about = _about(robot, SCENARIOS[0], robot.duration)
    points = [_point(about, bench.contestants[i], s, errors[i, s], costs[i, s]) for i, s in jobs]
    return _truth_record(about, reference), points


def _cases(
    bench: Bench, settings: Callable[[Contestant], tuple[float, ...]]
) -> list[tuple[int, float]]:
    who = enumerate(bench.contestants)
    return [(i, s) for i, c in who for s in bench.thinned(c, settings(c))]


def _free_job(trial: Trial, robot: Robot) -> Job:
    still = np.zeros(robot.n)
    return steady(lambda: trial.reset(robot.q0, still), lambda: trial.advance(robot.duration))


def _closed(bench: Bench, robot: Robot) -> tuple[Record, list[Record]]:
    loop = Loop(robot, ticks=1000 if bench.quick else 2000)
    label = f"truth: {robot.name}, controlled"
    reference = bench.once(label, lambda: solution.closed_loop(robot, loop))
    jobs: dict[tuple[int, float], Job] = {}
    errors: dict[tuple[int, float], float] = {}
    cases = _cases(bench, lambda who: who.tick_settings)
    for i, setting in bench.each(f"errors: {robot.name}, controlled", cases):
        trial = bench.contestants[i].build(robot, setting)
        positions, torques = loop.run(trial)
        errors[i, setting] = _error(positions, reference.q)
        jobs[i, setting] = _replay_job(trial, robot, torques)
    costs = bench.time(f"time: {robot.name}, controlled", jobs)
    about = _about(robot, SCENARIOS[1], loop.ticks * 1e-3)
    points = [_point(about, bench.contestants[i], s, errors[i, s], costs[i, s]) for i, s in jobs]
    return _truth_record(about, reference), points


def _replay_job(trial: Trial, robot: Robot, torques: np.ndarray) -> Job:
    still = np.zeros(robot.n)
    return steady(lambda: trial.reset(robot.q0, still), lambda: trial.replay(torques))


def _error(q: np.ndarray, reference: np.ndarray) -> float:
    return float(np.abs(q - reference).max())


def _about(robot: Robot, scenario: str, duration: float) -> Record:
    return {"robot": robot.name, "scenario": scenario, "duration_s": duration}


def _truth_record(about: Record, reference: solution.Truth) -> Record:
    return about | {"halving_rad": reference.halving, "other_method_rad": reference.other}


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
