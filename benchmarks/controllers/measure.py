# SPDX-License-Identifier: Apache-2.0
"""Runs one contender on one case and measures it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.control.custom import Maker
from arm_dynamics.trajectory import Reference
from arm_sim.exceptions import SimulationDiverged
from arm_sim.recording.recording import Recording
from arm_sim.simulation.simulator import Simulator
from benchmarks.controllers.cases import JUMP, PACES, PLANTS, STAY, TASKS, Arm
from benchmarks.controllers.contenders import CONTENDERS, contender

_SETTLED = 0.02  # of the way


@dataclass(frozen=True)
class Result:
    """One run, in numbers."""

    arm: str  # key of the arm
    title: str  # its title
    plant: str  # key of the plant
    task: str  # ``regulation`` or ``line``
    pace: str  # ``slow`` or ``fast``
    controller: str  # name of the controller
    error: float  # largest distance of the hand from its reference in [mm]
    aside: float | None  # largest distance from the straight line in [mm]; None for regulation
    final: float  # mean distance from the goal over the last 0.1 s in [mm]
    overshoot: float  # how far the hand runs past the goal, along the way to it, in [%] of the way
    # Time after the end of the reference until the hand stays within 2 % of the way from the goal
    # in [s]; inf if it does not
    settling: float
    effort: float  # root mean square of the torque over time, all joints together, in [N m]
    energy: float  # work that the drives put in, each alone; what one brakes is lost; in [J]
    saturated: float  # share of the time with a torque at its limit in [%]
    time: Array  # times of the course in [s]
    course: Array  # distance of the hand from its reference over time in [mm]


def compare(arms: Sequence[Arm], competing: Mapping[str, str | Maker]) -> Iterator[Result]:
    """Run each contender on each case, those of an arm's plant by one simulator."""
    for arm, plant in product(arms, PLANTS):
        sim = Simulator(arm.plant(plant), dt=1e-3)
        for task, pace, (controller, name) in product(TASKS, PACES, competing.items()):
            yield run(arm, sim, plant, task, pace, controller, name)


def run(
    arm: Arm, sim: Simulator, plant: str, task: str, pace: str, controller: str,
    name: str | Maker | None = None,
) -> Result:  # fmt: skip
    limit = sim.model.effort_limit
    control = contender(controller, arm, sim.dt, limit, name or CONTENDERS[controller])
    sample, duration = arm.motion(task, pace)
    sim.reset()
    try:
        done = sim.run(
            duration,
            lambda s: np.clip(control.torque(s, sample(s.time)), -limit, limit),
        )
    except SimulationDiverged as error:
        assert error.recording is not None
        done = error.recording
    numbers = _measured(arm, done, sample, task, pace, limit)
    return Result(arm.key, arm.title, plant, task, pace, controller, **numbers)


def _measured(
    arm: Arm, done: Recording, sample: Callable[[float], Reference], task: str, pace: str,
    limit: Array,
) -> dict[str, Any]:  # fmt: skip
    references = [sample(float(t)) for t in done.time]
    wanted = arm.task.pose(np.array([r.q for r in references])).position
    hand = arm.task.pose(done.q).position
    course = 1e3 * np.linalg.norm(hand - wanted, axis=1)
    start, goal = arm.task.pose(arm.nominal.model.q0).position, arm.task.pose(arm.goal).position
    way = float(np.linalg.norm(goal - start))
    along = (goal - start) / way
    from_goal = np.linalg.norm(hand - goal, axis=1)
    past = (hand - goal) @ along
    side = hand - start - np.outer((hand - start) @ along, along)
    jumps = task == "regulation" and pace == "fast"
    led = done.time[-1] - (JUMP if jumps else STAY)
    work = done.tau[:-1] * np.diff(done.q, axis=0)
    return {
        "error": float(course.max()),
        "aside": float(1e3 * np.linalg.norm(side, axis=1).max()) if task == "line" else None,
        "final": float(1e3 * from_goal[-100:].mean()),
        "overshoot": float(100.0 * max(past.max(), 0.0) / way),
        "settling": _settling(done.time, from_goal > _SETTLED * way, max(led, 0.0)),
        "effort": float(np.sqrt(np.mean(np.sum(done.tau**2, axis=1)))),
        "energy": float(np.maximum(work, 0.0).sum()),
        "saturated": float(100.0 * np.mean((abs(done.tau) >= limit).any(axis=1))),
        "time": done.time,
        "course": course,
    }


def _settling(time: Array, away: NDArray[np.bool_], led: float) -> float:
    if away[-1]:
        return float(np.inf)
    last = int(np.flatnonzero(away)[-1]) if away.any() else 0
    return max(0.0, float(time[last]) - led)
