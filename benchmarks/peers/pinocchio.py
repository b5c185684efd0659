# SPDX-License-Identifier: Apache-2.0
"""Pinocchio's ``aba``: it integrates nothing, so it is compared by the evaluation only."""

import numpy as np
import pinocchio as pin

from benchmarks.measurement.timing import Job, cpu
from benchmarks.robots.models import Robot

BATCH = 1000


def compiled(robot: Robot) -> Job:
    """Seconds for one ``aba`` called from C++."""
    return in_one_thread(robot.pin, *states(robot))


def in_one_thread(model: pin.Model, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> Job:
    """The same for a batch of states, each a column, by ``abaInParallel``."""
    pool, out = pin.ModelPool(model, 1), np.zeros_like(v)
    return lambda: cpu(lambda: pin.abaInParallel(1, pool, q, v, tau, out)) / v.shape[1]


def states(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and torques, shape (n, BATCH) each, drawn at random."""
    rng = np.random.default_rng(0)
    q, v, tau = (np.asfortranarray(rng.uniform(-1, 1, (robot.n, BATCH))) for _ in range(3))
    return q, v, tau
