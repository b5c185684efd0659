# SPDX-License-Identifier: Apache-2.0
"""Pinocchio's ``aba``: it integrates nothing, so it is compared by the evaluation only."""

import numpy as np
import pinocchio as pin

from benchmarks.measurement.timing import Job, cpu
from benchmarks.robots.models import Robot

BATCH = 1000


def compiled(robot: Robot) -> Job:
    """Seconds for one ``aba`` called from C++: a batch in one thread by ``abaInParallel``."""
    pool = pin.ModelPool(robot.pin, 1)
    q, v, tau = states(robot)
    out = np.zeros_like(q)
    return lambda: cpu(lambda: pin.abaInParallel(1, pool, q, v, tau, out)) / BATCH


def interpreted(robot: Robot) -> Job:
    """Seconds for one ``aba`` called from Python, with the faster of its two conventions."""
    model, data, world = robot.pin, robot.pin.createData(), pin.Convention.WORLD
    some = [tuple(x[:, k].copy() for x in states(robot)) for k in range(BATCH)]

    def calls() -> None:
        for q, v, tau in some:
            pin.aba(model, data, q, v, tau, world)

    return lambda: cpu(calls) / BATCH


def states(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and torques, shape (n, BATCH) each, drawn at random."""
    rng = np.random.default_rng(0)
    q, v, tau = (np.asfortranarray(rng.uniform(-1, 1, (robot.n, BATCH))) for _ in range(3))
    return q, v, tau
