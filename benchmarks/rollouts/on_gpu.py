# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.rollouts.on_gpu``."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from functools import partial

import click
import numpy as np

from benchmarks.measurement.machine import processor
from benchmarks.peers import ours
from benchmarks.reporting.markdown import table
from benchmarks.robots.models import panda
from benchmarks.studies.rollouts import STEP, STEPS, Fleet, starts

ARMS = (256, 1024, 4096, 16384, 65536)
REPEATS = 5
SAME = 1e-5  # [rad], between double and single precision after 50 steps


@click.command()
@click.option("--device", default="cuda:0", show_default=True, help="A device of Warp.")
@click.option("--arms", type=int, multiple=True, default=ARMS, show_default=True)
def main(device: str, arms: tuple[int, ...]) -> None:
    """Time many Pandas on a graphics processor, and on the processor by this suite.

    Million arm-steps per second of wall time: semi-implicit steps of 1 ms, 50 in a call, every
    state kept; by this suite in double precision, by MuJoCo Warp and Newton in single precision,
    as a recorded graph, with their states copied to the host or left where they are.
    """
    try:
        import warp

        from benchmarks.peers import mujoco_warp, newton, warp_fleet
    except ImportError as error:
        raise click.ClickException(f"{error}: './arm bench' installs the peers") from None
    try:
        where = warp.get_device(device).name
    except (RuntimeError, ValueError) as error:
        raise click.BadParameter(f"{error}", param_hint="--device") from None
    robot, cores = panda(), len(os.sched_getaffinity(0))
    own: dict[str, Fleet] = {
        f"arm_sim, {threads} threads": ours.fleet("semi_implicit_euler", STEP, STEPS, None)(
            robot, threads
        )
        for threads in sorted({1, cores})
    }
    peers = {
        who: warp_fleet.fleet_maker(world, device, STEP, STEPS)(robot, 1)
        for who, world in (("MuJoCo Warp", mujoco_warp.World), ("Newton", newton.World))
    }
    rows: dict[str, list[str]] = {}
    for count in arms:
        some = starts(robot, count)
        for name, fleet in own.items():
            ends = np.asarray(fleet(*some))[:, -1, : robot.n].copy()
            rows.setdefault(name, []).append(_rate(partial(fleet, *some), count))
        for name, fleet in peers.items():
            if (off := abs(fleet(*some)[-1, 0] - ends).max()) > SAME:
                raise click.ClickException(f"{name} ends {off:.1e} rad from arm_sim")
            copied, left = partial(fleet, *some), partial(fleet.run, count)
            rows.setdefault(f"{name}, copied to the host", []).append(_rate(copied, count))
            rows.setdefault(name, []).append(_rate(left, count))
        click.echo(f"{count} arms", err=True)
    click.echo(f"{where}; {processor()}")
    click.echo(table(("who", *map(str, arms)), [(name, *row) for name, row in rows.items()]))


def _rate(call: Callable[[], object], count: int) -> str:
    """Million arm-steps per second, from the median time of a call."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return f"{1e-6 * count * STEPS / float(np.median(times)):.3g}"


if __name__ == "__main__":
    main(prog_name="python -m benchmarks.rollouts.on_gpu")
