# SPDX-License-Identifier: Apache-2.0
"""Many arms at once: arm-steps per second and core, against MuJoCo."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from benchmarks.robots.models import Robot
from benchmarks.studies.bench import Bench, Record

STEP = 1e-3
STEPS = 50
ARMS = (1, 8, 64, 1024)
QUICK_ARMS = (8, 512)


class Fleet(Protocol):
    """Rolls many arms with torques of their own, held for all steps, and keeps every state."""

    def __call__(self, q0: np.ndarray, v0: np.ndarray, tau: np.ndarray) -> object:
        """Each argument has shape (arms, n); ``STEPS`` steps of ``STEP`` are made."""


Fleets = dict[str, Callable[[Robot, int], Fleet]]  # label -> (robot, threads) -> fleet


def peers() -> Fleets:
    """MuJoCo's rollout with its Euler and RK4 steps, where it is installed."""
    fleets: Fleets = {}
    if find_spec("mujoco"):
        from benchmarks.peers import mujoco as mujoco_peer

        fleets |= {f"MuJoCo {m}": mujoco_peer.fleet(m, STEP, STEPS) for m in ("Euler", "RK4")}
    return fleets


@dataclass
class Sample:
    """Calls of one fleet: processor time of all its threads, and wall time beside it."""

    fleet: Fleet  # to be timed
    starts: tuple[np.ndarray, np.ndarray, np.ndarray]  # its arguments
    calls: int  # per sample
    # wall time of one arm-step [s], one entry a sample
    walls: list[float] = field(default_factory=list)

    def __call__(self) -> float:
        """Processor time of one arm-step [s]."""
        steps = self.calls * len(self.starts[0]) * STEPS
        wall, processor = time.perf_counter(), time.process_time()
        for _ in range(self.calls):
            self.fleet(*self.starts)
        self.walls.append((time.perf_counter() - wall) / steps)
        return (time.process_time() - processor) / steps


def run(bench: Bench, ours: Fleets) -> Record:
    """Arm-steps per second of processor time, which is one core's, and of wall time."""
    cores = len(os.sched_getaffinity(0))
    rows: list[Record] = []
    for robot in bench.robots():
        samples = _samples(bench, robot, ours | peers(), cores)
        costs = bench.time(f"rollouts: {robot.name}", samples)
        rows += [
            {
                "robot": robot.name,
                "who": who,
                "threads": threads,
                "arms": arms,
                "steps": STEPS,
                "arm_steps_per_s": 1 / float(np.median(samples[who, threads, arms].walls)),
                "arm_steps_per_s_per_core": 1 / costs[who, threads, arms].median,
                "rounds_s_per_core": list(costs[who, threads, arms].samples),
            }
            for who, threads, arms in samples
        ]
    return {"cores": cores, "rows": rows}


def _samples(
    bench: Bench, robot: Robot, fleets: Fleets, cores: int
) -> dict[tuple[str, int, int], Sample]:
    samples: dict[tuple[str, int, int], Sample] = {}
    for who, build in fleets.items():
        for threads in sorted({1, cores}):
            fleet = build(robot, threads)
            for arms in QUICK_ARMS if bench.quick else ARMS:
                samples[who, threads, arms] = _sample(fleet, robot, arms)
    return samples


def _sample(fleet: Fleet, robot: Robot, arms: int) -> Sample:
    some = starts(robot, arms)
    fleet(*some)
    return Sample(fleet, some, max(1, round(20_000 / (arms * STEPS))))


def starts(robot: Robot, arms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and torques, shape (arms, n) each, drawn at random."""
    rng = np.random.default_rng(0)
    q0 = robot.q0 + rng.uniform(-0.1, 0.1, (arms, robot.n))
    v0 = rng.uniform(-0.1, 0.1, (arms, robot.n))
    return q0, v0, rng.uniform(-1, 1, (arms, robot.n))
