# SPDX-License-Identifier: Apache-2.0
"""Inputs and results of runs: values that are sent between processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from arm_dynamics import ArmError
from arm_dynamics.exceptions import plain
from arm_sim.exceptions import SimulationDiverged

# How a run ended.
DONE, DIVERGED, FAILED = "done", "diverged", "failed"


@dataclass(frozen=True)
class Job:
    """One run of a world.

    Attributes:
        index: Its number in the design.
        noise: Seed of its noise.
        values: Varied values by key, without those that define the world.
    """

    index: int
    noise: int
    values: dict[str, Any]


@dataclass(frozen=True)
class Row:
    """Result of a run.

    Attributes:
        index: Its number in the design.
        status: ``done``, ``diverged`` or ``failed``.
        note: The reason if it was not done; else empty.
        metrics: Values in the study's order; NaN if it was not done.
    """

    index: int
    status: str
    note: str
    metrics: tuple[float, ...]

    @classmethod
    def failed(cls, job: Job, error: ArmError, metrics: Sequence[str]) -> Row:
        """The row of a run that ended with an error."""
        status = DIVERGED if isinstance(error, SimulationDiverged) else FAILED
        return cls(job.index, status, plain(error, 300), (float("nan"),) * len(metrics))


@dataclass(frozen=True)
class Recipe:
    """Inputs of a world: text and numbers, which can be sent to other processes.

    Attributes:
        scene: Content of the scene file, as JSON with the text of the robot description.
        controller_scene: Content of the controller's scene, as JSON.
        controller: The study's choice, as JSON.
        motion: The study's motion, as JSON.
        duration: Duration of a run in [s].
        metrics: Names of the metrics.
        slots: Indices of varied values in their tunable quantities, by key.
        imperfect: Whether the scene has imperfect sensors or commands.
        lanes: Whether there are enough runs to compile code that simulates several side by side.
    """

    scene: str
    controller_scene: str
    controller: str
    motion: str
    duration: float
    metrics: tuple[str, ...]
    slots: tuple[tuple[str, tuple[int, ...]], ...]
    imperfect: bool
    lanes: bool
