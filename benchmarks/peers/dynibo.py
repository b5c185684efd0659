# SPDX-License-Identifier: Apache-2.0
"""dynibo, in Rust: it integrates nothing, so it is compared by the evaluation only."""

from pathlib import Path
from tempfile import TemporaryDirectory

import dynibo
import numpy as np

from benchmarks.measurement.timing import Job, cpu
from benchmarks.peers.pinocchio import BATCH, states
from benchmarks.robots.models import Robot


def interpreted(robot: Robot) -> Job:
    """Seconds for one ``forward_dynamics`` called from Python, which writes where it is told."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(robot.urdf)
        arm = dynibo.Robot.from_urdf(str(path))
    some = [tuple(x[:, k].copy() for x in states(robot)) for k in range(BATCH)]
    out = np.empty(robot.n)

    def calls() -> None:
        for q, v, tau in some:
            arm.forward_dynamics(q, v, tau, out=out)

    return lambda: cpu(calls) / BATCH
