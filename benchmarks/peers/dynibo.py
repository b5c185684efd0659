# SPDX-License-Identifier: Apache-2.0
"""dynibo, in Rust: it integrates nothing, so it is compared by the evaluation only."""

import dynibo
import numpy as np

from benchmarks.measurement.timing import Job, cpu
from benchmarks.peers.pinocchio import BATCH, states
from benchmarks.robots.models import Robot
from benchmarks.robots.urdf import in_file


def interpreted(robot: Robot) -> Job:
    """Seconds for one ``forward_dynamics`` called from Python, which writes where it is told."""
    with in_file(robot.urdf) as path:
        arm = dynibo.Robot.from_urdf(path)
    some = [tuple(x[:, k].copy() for x in states(robot)) for k in range(BATCH)]
    out = np.empty(robot.n)

    def calls() -> None:
        for q, v, tau in some:
            arm.forward_dynamics(q, v, tau, out=out)

    return lambda: cpu(calls) / BATCH
