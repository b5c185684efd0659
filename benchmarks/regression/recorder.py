# SPDX-License-Identifier: Apache-2.0
"""Run by ``paired.py`` in a process of its own, in this tree and in an older one.

Takes the lines as JSON from the file that is its argument, then the name of a line for every
measurement from its input; answers each with the processor time of one unit of work in [s], or
why there is none. Only the public interface is used: the modules of the trees differ.
"""

import json
import math
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import arm_sim
from arm_dynamics import Dynamics
from arm_sim import Simulator

SAMPLE = 5e-3  # [s], a measurement is repeated and averaged until it is as long as this
DT = 1e-3  # [s]
Job = tuple[Callable[[], object], Callable[[], object], int]  # prepare, do, units of work


def run(line: dict[str, Any]) -> Job:
    simulator, ticks, start = _simulator(line), line["ticks"], _start(line)
    tau = line.get("tau")
    return lambda: simulator.reset(*start), lambda: simulator.run(ticks * DT, tau), ticks


def step(line: dict[str, Any]) -> Job:
    simulator, ticks, start = _simulator(line), line["ticks"], _start(line)
    still = np.zeros(simulator.n)

    def steps() -> None:
        for _ in range(ticks):
            simulator.step(still)

    return lambda: simulator.reset(*start), steps, ticks


def rollout(line: dict[str, Any]) -> Job:
    """Steps of one arm among many, in lanes, one thread."""
    simulator, arms, ticks = _simulator(line), line["arms"], line["ticks"]
    q0, v0, tau = np.random.default_rng(0).uniform(-1.0, 1.0, (3, arms, simulator.n))
    return (
        lambda: None,
        lambda: simulator.rollout(q0, v0, tau, ticks, last_only=True, threads=1),
        arms * ticks,
    )


def inverse(line: dict[str, Any]) -> Job:
    dynamics = Dynamics(line["scene"])
    q, v, a = np.random.default_rng(0).uniform(-1.0, 1.0, (3, line["points"], dynamics.n))
    return lambda: None, lambda: dynamics.inverse(q, v, a), line["points"]


def forward(line: dict[str, Any]) -> Job:
    dynamics = Dynamics(line["scene"])
    q, v, tau = np.random.default_rng(0).uniform(-1.0, 1.0, (3, line["points"], dynamics.n))
    return lambda: None, lambda: dynamics.forward(q, v, tau), line["points"]


KINDS = {kind.__name__: kind for kind in (run, step, rollout, inverse, forward)}


def _simulator(line: dict[str, Any]) -> Simulator:
    method = {key: line[key] for key in ("integrator", "tolerance") if key in line}
    return Simulator(line["scene"], dt=DT, **method)


def _start(line: dict[str, Any]) -> tuple[Any, Any]:
    return line.get("q"), line.get("v")


def _timed(job: Job) -> float:
    """Processor time of one call in [s]."""
    prepare, call, _ = job
    prepare()
    began = time.process_time()
    call()
    return time.process_time() - began


def main() -> None:
    lines = json.loads(Path(sys.argv[1]).read_text())

    @cache
    def ready(name: str) -> tuple[Job, int]:
        job = KINDS[lines[name]["kind"]](lines[name])
        _timed(job)
        return job, max(1, math.ceil(SAMPLE / max(_timed(job), 1e-6)))

    print(arm_sim.__file__, flush=True)
    for request in sys.stdin:
        try:
            job, count = ready(request.rstrip("\n"))
            answer: object = sum(_timed(job) for _ in range(count)) / (count * job[2])
        except Exception as error:  # an older tree may lack what a line needs
            answer = f"{type(error).__name__}: {error}"
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
