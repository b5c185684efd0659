# SPDX-License-Identifier: Apache-2.0
"""How long a batch through the service takes, by UDP and with 64 MB of shared memory.

./arm python -m benchmarks.latency.long_batches

UDP is what the nodes use by themselves, 64 MB of shared memory what ``large_batches.xml`` gives. A
Panda's dynamics node runs in a process of its own, and so does who asks it.
"""

from __future__ import annotations

import os
import tempfile
from importlib.resources import files
from multiprocessing import get_context
from pathlib import Path
from timeit import repeat

import numpy as np
from rich.console import Console
from rich.table import Table

from arm_dynamics.client import ArmClient
from arm_dynamics.ros.common.transport import DISCOVERY, with_room
from arm_sim.cli.demo.processes import Processes, free_domain

POINTS = 1000, 3000, 10_000, 30_000, 100_000
CALLS = 21
WAYS = {"UDP": {DISCOVERY: "SYSTEM_DEFAULT"}, "64 MB": with_room()}


def measured(environment: dict[str, str]) -> list[list[float]]:
    """Time in [s] of every call, a row for each number of points."""
    os.environ |= environment | {"ROS_DOMAIN_ID": str(free_domain())}
    scene = str(files("arm_sim") / "scenes/panda.yaml")
    with (
        tempfile.TemporaryDirectory() as folder,
        Processes(Path(folder)) as processes,
        ArmClient(timeout=30.0) as arm,
    ):
        processes.start("dynamics", "dynamics", scene, "--with-parent")
        n = len(arm.model_info().joint_names)
        state = np.random.default_rng(0).uniform(-1.0, 1.0, (3, max(POINTS), n))
        arm.inverse_dynamics(*state)  # compiles, and touches the memory
        batches = [[x[:points] for x in state] for points in POINTS]
        return [
            repeat(lambda b=b: arm.inverse_dynamics(*b), number=1, repeat=CALLS) for b in batches
        ]


def main() -> None:
    """Print the median and the longest time of a call, each way."""
    console, spawn, found = Console(), get_context("spawn"), {}
    with console.status("asking …"):
        for way, environment in WAYS.items():
            # A process of its own: Fast DDS reads its profiles once.
            with spawn.Pool(1) as pool:
                found[way] = pool.apply(measured, (environment,))
    heads = (f"{way}: {what}" for way in WAYS for what in ("median", "longest"))
    table = Table("points", *heads, title="time of a call in ms")
    for k, points in enumerate(POINTS):
        times = (1e3 * f(found[way][k]) for way in WAYS for f in (np.median, max))
        table.add_row(f"{points:,}", *(f"{time:.1f}" for time in times))
    console.print(table)


if __name__ == "__main__":
    main()
