# SPDX-License-Identifier: Apache-2.0
"""Energy of a free, frictionless arm: it must not change, over 1, 10, 100 and 1000 s."""

import math
import time

import numpy as np
import pinocchio as pin

from benchmarks.peers.base import Contestant, Trial
from benchmarks.robots.models import Robot, panda
from benchmarks.studies.bench import Bench, Record

HORIZONS = (1.0, 10.0, 100.0, 1000.0)  # [s]
LOOKS = 20  # per horizon, at most: how often the energy is looked at, at whole seconds
PATIENCE = 60.0  # [s] of wall time for one horizon, beyond which the next is left out
SETTINGS = {"step": (1e-3,), "tolerance": (1e-6, 1e-9)}


def run(bench: Bench) -> Record:
    """Largest energy error up to each horizon, for every contestant at its usual setting."""
    robot, some = panda(), slice(1 if bench.quick else None)
    cases = [(c, s) for c in bench.contestants for s in SETTINGS[c.knob][some]]
    drifts = (_drifts(bench, robot, *case) for case in bench.each("energy drift", cases))
    rows = [row for rows in drifts for row in rows]
    return {"robot": robot.name, "scale_J": _scale(robot), "rows": rows}


def _drifts(bench: Bench, robot: Robot, who: Contestant, setting: float) -> list[Record]:
    trial = who.build(robot, setting)
    trial.reset(robot.q0, np.zeros(robot.n))
    start = energy(robot, trial)
    rows: list[Record] = []
    now, worst, spent = 0.0, 0.0, 0.0
    for horizon in HORIZONS[: 2 if bench.quick else None]:
        if spent * 10 > PATIENCE:
            break
        began = time.perf_counter()
        looks = np.unique(np.linspace(now, horizon, LOOKS + 1).round())
        for seconds in np.diff(looks).tolist():
            trial.advance(seconds)
            drift = abs(energy(robot, trial) - start)
            worst = max(worst, drift) if math.isfinite(drift) else math.inf
        now, spent = horizon, time.perf_counter() - began
        rows.append(
            {
                "who": who.name,
                "knob": who.knob,
                "setting": setting,
                "horizon_s": horizon,
                "drift_J": worst if math.isfinite(worst) else None,
            }
        )
    return rows


def energy(robot: Robot, trial: Trial) -> float:
    """Kinetic and potential energy [J] by Pinocchio; NaN where the state is not a number."""
    q, v = trial.state()
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        return math.nan
    return pin.computeMechanicalEnergy(robot.pin, robot.pin.createData(), q, v)


def _scale(robot: Robot) -> float:
    """The potential energy that the arm can lose [J]: from its start to hanging at rest."""
    data = robot.pin.createData()
    rng = np.random.default_rng(0)
    poses = rng.uniform(-np.pi, np.pi, (2000, robot.n))
    lowest = min(pin.computePotentialEnergy(robot.pin, data, q) for q in poses)
    return float(pin.computePotentialEnergy(robot.pin, data, robot.q0) - lowest)
