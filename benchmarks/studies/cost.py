# SPDX-License-Identifier: Apache-2.0
"""What one step and one evaluation cost, and how that grows with the number of joints."""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from benchmarks.measurement.timing import Cost, Job, cpu, steady
from benchmarks.peers import ours
from benchmarks.peers import pinocchio as pinocchio_peer
from benchmarks.peers.base import OURS, Contestant
from benchmarks.robots.models import Robot, chain
from benchmarks.studies.bench import Bench, Record

STEP = 1e-3
ROUNDS = 9  # short ones, from which the claims are computed
STEPS = 500
LINKS = (2, 3, 5, 7, 10, 15, 20, 30, 40, 50)
QUICK_LINKS = (2, 7, 20)
GROWTH = ("euler", "rk4", "Euler", "RK4")


def run(bench: Bench) -> Record:
    rows: list[Record] = []
    for robot in bench.robots():
        jobs = _steps(bench, robot) | _evaluations(robot)
        costs = bench.time(f"cost of a step: {robot.name}", jobs, max(bench.repeats, ROUNDS))
        rows += [{"robot": robot.name, "what": what, "who": who} | _ns(costs[what, who])
                 for what, who in jobs]  # fmt: skip
    return {"rows": rows, "growth": _growth(bench)}


def _steps(bench: Bench, robot: Robot) -> dict[tuple[str, str], Job]:
    stepping = [c for c in bench.contestants if c.knob == "step"]
    return {("step", c.name): step_job(c, robot) for c in stepping}


def _evaluations(robot: Robot) -> dict[tuple[str, str], Job]:
    ways = {
        "Pinocchio's ABA from C++ (abaInParallel, one thread)": pinocchio_peer.compiled,
        f"{OURS} generated forward dynamics from C": ours.evaluation,
    }
    if find_spec("dynibo"):
        from benchmarks.peers import dynibo as dynibo_peer

        ways["dynibo from Python"] = dynibo_peer.interpreted
    return {("evaluation", label): build(robot) for label, build in ways.items()}


def step_job(who: Contestant, robot: Robot) -> Job:
    """Seconds for one step of 1 ms, rolled the way that suits the simulator."""
    trial = who.build(robot, STEP)
    still = np.zeros(robot.n)
    job = steady(lambda: trial.reset(robot.q0, still), lambda: trial.advance(STEPS * STEP))
    return lambda: job() / STEPS


def _growth(bench: Bench) -> list[Record]:
    links = QUICK_LINKS if bench.quick else LINKS
    chosen = [c for c in bench.contestants if c.method in GROWTH]
    jobs: dict[tuple[int, str], Job] = {}
    for n in bench.each("building chains", list(links)):
        robot = chain(n)
        jobs |= {(n, c.name): step_job(c, robot) for c in chosen}
        jobs |= {(n, key[1]): job for key, job in _evaluations(robot).items()}
    costs = bench.time("cost against number of joints", jobs)
    return [{"joints": n, "who": who} | _ns(costs[n, who]) for n, who in jobs]


def _ns(cost: Cost) -> Record:
    c = cost.scaled(1e9)
    return {"ns": c.median, "low_ns": c.low, "high_ns": c.high, "rounds_ns": list(c.samples)}


def repeated(call: Callable[[], object], count: int = 2000) -> Job:
    """Seconds for one of many equal calls from Python."""

    def calls() -> None:
        for _ in range(count):
            call()

    return lambda: cpu(calls) / count
