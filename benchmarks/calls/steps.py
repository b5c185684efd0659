# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.calls.steps``: ticks asked for one by one, beside MuJoCo's."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import click
import mujoco
import numpy as np

from arm_sim import Simulator
from benchmarks.measurement.intervals import of_median
from benchmarks.measurement.timing import Noise, cpu, interleaved
from benchmarks.peers.base import TICK
from benchmarks.peers.mujoco import compile_model
from benchmarks.reporting.markdown import table
from benchmarks.robots.models import Robot, panda

TICKS = 2000
PEER = "`mujoco.mj_step`, {}"
Job = Callable[[], object]


@click.command()
@click.option("--repeats", default=40, show_default=True, help="Rounds.")
def main(repeats: int) -> None:
    """Time ticks of a Panda of 1 ms from Python, in turn, and their ratios to MuJoCo's."""
    robot = panda()
    theirs = {PEER.format(method): _theirs(robot, method) for method in ("Euler", "RK4")}
    jobs = {name: partial(cpu, job) for name, job in (_ours(robot) | theirs).items()}
    costs = interleaved(jobs, repeats, Noise(), lambda: None)
    rows = []
    for name, cost in costs.items():
        ratio = np.divide(cost.samples, costs[PEER.format("Euler")].samples)
        low, high = of_median(ratio.tolist())
        times = (1e6 * time / TICKS for time in (min(cost.samples), cost.median))
        shown = (f"{time:.2f}" for time in times)
        rows.append((name, *shown, f"{np.median(ratio):.2f}", f"{low:.2f} – {high:.2f}"))
    click.echo(table(("tick", "least [µs]", "median [µs]", "ratio", "95 % interval"), rows))


def _ours(robot: Robot) -> dict[str, Job]:
    sim, still = Simulator(robot.urdf, integrator="rk4", dt=TICK), np.zeros(robot.n)

    def steps(tau: object) -> None:
        sim.reset(robot.q0)
        for _ in range(TICKS):
            sim.step(tau)

    def run(control: object) -> None:
        sim.reset(robot.q0)
        sim.run(TICKS * TICK, control)

    return {
        "`Simulator.step`, an array": lambda: steps(still),
        "`Simulator.step`, a list": lambda: steps(still.tolist()),
        "`Simulator.run`, a function": lambda: run(lambda _: still),
        "`Simulator.run`, a torque": lambda: run(still),
    }


def _theirs(robot: Robot, method: str) -> Job:
    """A torque for every tick, whose state is read where MuJoCo keeps it."""
    model, still = compile_model(robot, method, TICK), np.zeros(robot.n)
    data = mujoco.MjData(model)
    torque = data.qfrc_applied

    def steps() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = robot.q0
        for _ in range(TICKS):
            torque[:] = still
            mujoco.mj_step(model, data)

    return steps


if __name__ == "__main__":
    main()
