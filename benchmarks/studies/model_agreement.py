# SPDX-License-Identifier: Apache-2.0
"""Is it the same arm in every simulator? Forward dynamics against Pinocchio on random states."""

import numpy as np
import pinocchio as pin

from benchmarks.peers.base import Contestant
from benchmarks.robots.models import Robot
from benchmarks.studies.bench import Bench, Record

STATES = 20
PROBE = {"step": 1e-3, "tolerance": 1e-6}


def run(bench: Bench) -> Record:
    """Largest relative difference in acceleration for every contestant and robot."""
    cases = [(robot, who) for robot in bench.robots() for who in bench.contestants]
    rows = [
        {
            "robot": robot.name,
            "who": who.name,
            "family": who.family,
            "relative": _difference(robot, who),
        }
        for robot, who in bench.each("same arm in every simulator", cases)
    ]
    return {"states": STATES, "rows": rows}


def _difference(robot: Robot, who: Contestant) -> float:
    rng = np.random.default_rng(1)
    trial = who.build(robot, PROBE[who.knob])
    data = robot.pin.createData()
    worst = 0.0
    for _ in range(STATES):
        q, v, tau = rng.uniform(-1, 1, (3, robot.n))
        expected = pin.aba(robot.pin, data, q, v, tau)
        result = trial.acceleration(q, v, tau)
        worst = max(worst, float(np.abs(result - expected).max() / np.abs(expected).max()))
    return worst
