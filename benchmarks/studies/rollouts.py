# SPDX-License-Identifier: Apache-2.0
"""Many arms at once: arm-steps per second and core, against MuJoCo."""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from benchmarks.measurement.timing import Job, cpu
from benchmarks.peers import ours
from benchmarks.peers.base import OURS
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


Fleets = dict[str, Callable[[Robot], Fleet]]  # by label


def fleets() -> Fleets:
    """Ours, and MuJoCo's rollout with its Euler and RK4 steps, where it is installed."""
    fleets: Fleets = {
        f"{OURS} {method}{label}": ours.fleet(method, STEP, STEPS, lanes)
        for method, label, lanes in (
            ("euler", "", None), ("rk4", "", None), ("rk4", ", 256 bits", 4),
            ("rk4", ", without SIMD", 1),
        )
    }  # fmt: skip
    if find_spec("mujoco"):
        from benchmarks.peers import mujoco as mujoco_peer

        fleets |= {f"MuJoCo {m}": mujoco_peer.fleet(m, STEP, STEPS) for m in ("Euler", "RK4")}
    return fleets


def run(bench: Bench) -> Record:
    """Arm-steps per second of one core, by processor time."""
    rows: list[Record] = []
    for robot in bench.robots():
        jobs = {
            (who, arms): _job(build(robot), robot, arms)
            for who, build in fleets().items()
            for arms in (QUICK_ARMS if bench.quick else ARMS)
        }
        costs = bench.time(f"rollouts: {robot.name}", jobs)
        rows += [
            {
                "robot": robot.name,
                "who": who,
                "arms": arms,
                "arm_steps_per_s_per_core": 1 / cost.median,
                "rounds_s_per_core": list(cost.samples),
            }
            for (who, arms), cost in costs.items()
        ]
    return {"rows": rows}


def _job(fleet: Fleet, robot: Robot, arms: int) -> Job:
    """Processor time of one step of one arm [s]."""
    some = starts(robot, arms)
    calls = max(1, round(20_000 / (arms * STEPS)))
    fleet(*some)

    def roll() -> None:
        for _ in range(calls):
            fleet(*some)

    return lambda: cpu(roll) / (calls * arms * STEPS)


def starts(robot: Robot, arms: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and torques, shape (arms, n) each, drawn at random."""
    rng = np.random.default_rng(0)
    q0 = robot.q0 + rng.uniform(-0.1, 0.1, (arms, robot.n))
    v0 = rng.uniform(-0.1, 0.1, (arms, robot.n))
    return q0, v0, rng.uniform(-1, 1, (arms, robot.n))
