# SPDX-License-Identifier: Apache-2.0
"""Many arms, every method, every step, on every core."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context

from arm_dynamics import ArmError, ArmModel, load_scene
from arm_sim.integrators.methods import METHODS
from benchmarks.stress.arms import MOST_JOINTS, Arm, draw
from benchmarks.stress.motion import HORIZON, TICK, Motion, solve
from benchmarks.stress.verdict import NAN, REFUSED, Result, Setting, attempt

STEPS = (1e-2, 1e-3, 1e-4, 1e-5)  # [s]
TOLERANCES = (1e-6, 1e-9)
REFERENCE = "reference"
LONG_TO_COMPILE = {"implicit": 10}  # joints: with more of them its Jacobian takes too long


@dataclass(frozen=True)
class Plan:
    """What to try on each arm.

    Attributes:
        steps: lengths of a tick [s].
        tolerances: of error control.
        most_joints: of an arm.
        horizon: how long to follow it [s].
        backend: of the simulator.
    """

    steps: tuple[float, ...] = STEPS
    tolerances: tuple[float, ...] = TOLERANCES
    most_joints: int = MOST_JOINTS
    horizon: float = HORIZON
    backend: str = "auto"

    def settings(self, joints: int = 1) -> list[Setting]:
        """Every method with fixed steps, and with error control where it has it."""
        names = [name for name in METHODS if joints <= LONG_TO_COMPILE.get(name, MOST_JOINTS)]
        fixed = [Setting(name, dt) for name in names for dt in self.steps]
        able = [name for name in names if METHODS[name].adaptive]
        return fixed + [Setting(name, dt, t) for name in able for t in self.tolerances
                        for dt in self.steps]  # fmt: skip


@dataclass(frozen=True)
class Found:
    """Everything that was found about one arm.

    Attributes:
        seed: of the arm.
        arm: the arm; None if it was refused.
        motion: what it really does.
        results: of all settings.
    """

    seed: int
    arm: Arm | None
    motion: Motion
    results: tuple[Result, ...]


def examine(seed: int, plan: Plan) -> Found:
    """Try every setting on the arm of a seed."""
    try:
        arm = draw(seed, plan.most_joints)
        model = ArmModel(load_scene(arm.scene))
        motion = solve(arm, model, plan.backend, plan.horizon)
    except ArmError as error:
        refused = Result(seed, "every method", 0.0, REFUSED, message=str(error))
        return Found(seed, None, Motion(0.0, message=str(error)), (refused,))
    results = [attempt(arm, model, motion, way, plan.backend) for way in plan.settings(arm.n)]
    if not motion.finite:
        results.append(Result(seed, REFERENCE, TICK, NAN, message=motion.message))
    return Found(seed, arm, motion, tuple(results))


def survey(seeds: Sequence[int], plan: Plan, workers: int) -> Iterator[Found]:
    """Examine many arms side by side; compiled code goes to a folder that is removed at the end.

    Args:
        seeds: of the arms.
        plan: what to try.
        workers: processes.

    Yields:
        What was found, as it comes; the same for the same seeds and plan, in any order.
    """
    with tempfile.TemporaryDirectory(prefix="stress-") as folder:
        pool = ProcessPoolExecutor(
            workers, get_context("spawn"), initializer=_settle, initargs=(folder,)
        )
        with pool:
            jobs = [pool.submit(examine, seed, plan) for seed in seeds]
            try:
                for job in as_completed(jobs):
                    yield job.result()
            finally:
                pool.shutdown(cancel_futures=True)


def _settle(folder: str) -> None:
    """Prepare a worker process."""
    os.environ["XDG_CACHE_HOME"] = folder
