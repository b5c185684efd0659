# SPDX-License-Identifier: Apache-2.0
"""Metrics: numbers that summarize a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices


@dataclass(frozen=True)
class MeasuredRun:
    """A closed-loop run of k ticks and n joints.

    Attributes:
        dt: Length of a tick in [s].
        q: Positions at the ends of ticks, initial position included, in [rad] or [m], (k+1, n).
        reference: Desired positions, likewise.
        torque: Effective joint torques in [N m] or [N], shape (k, n).
        command: Commands, clipped to their limits, shape (k, n).
        limit: Command limits, infinite where there is none, shape (n,).
        stops: Positions of the lower and the upper stops, infinite where there is none, (2, n).
    """

    dt: float
    q: Array
    reference: Array
    torque: Array
    command: Array
    limit: Array
    stops: Array

    def of(self, joint: int) -> MeasuredRun:
        """The run of one joint alone."""
        names = "q", "reference", "torque", "command", "limit", "stops"
        own = {name: getattr(self, name)[..., joint : joint + 1] for name in names}
        return replace(self, **own)


@dataclass(frozen=True)
class Metric:
    """A metric of a run.

    Attributes:
        of: Function that computes it.
        name: What it is called in figures.
        unit: Its unit, for headings.
        meaning: Its definition.
    """

    of: Callable[[MeasuredRun], float]
    name: str
    unit: str
    meaning: str


def _error(run: MeasuredRun) -> Array:
    return run.q - run.reference


def _overshoot(run: MeasuredRun) -> float:
    """Largest overshoot relative to the distance, over joints with a goal away from the start."""
    distance = run.reference[-1] - run.reference[0]
    moved = distance != 0.0
    if not moved.any():
        return 0.0
    beyond = (run.q[:, moved] - run.reference[-1, moved]) / distance[moved]
    return float(np.maximum(beyond.max(), 0.0))


def _energy(run: MeasuredRun) -> float:
    """A torque that is constant over a tick does the work τ Δq in it."""
    return float(np.abs(run.torque * np.diff(run.q, axis=0)).sum())


def _stop_time(run: MeasuredRun) -> float:
    at = (run.q[1:] <= run.stops[0]) | (run.q[1:] >= run.stops[1])
    return float(run.dt * np.count_nonzero(at.any(axis=1)))


def _saturation(run: MeasuredRun) -> float:
    if not len(run.command):
        return 0.0
    return float((np.abs(run.command) >= run.limit).any(axis=1).mean())


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values))) if values.size else 0.0


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


METRICS: dict[str, Metric] = {
    "tracking_rms": Metric(
        lambda run: _root_mean_square(_error(run)), "RMS tracking error", "rad, m",
        "root mean square of the tracking error, over time and joints",
    ),
    "tracking_max": Metric(
        lambda run: _largest(_error(run)), "largest tracking error", "rad, m",
        "largest tracking error of a joint",
    ),
    "final_error": Metric(
        lambda run: _largest(_error(run)[-1]), "error at the end", "rad, m",
        "largest tracking error of a joint at the end",
    ),
    "overshoot": Metric(
        _overshoot, "overshoot", "1",
        "largest overshoot of a joint beyond its goal, relative to its distance from the start",
    ),
    "energy": Metric(
        _energy, "work of the drives", "J",
        "work of the drives, with driving and braking both counted positive",
    ),
    "torque_rms": Metric(
        lambda run: _root_mean_square(run.torque), "RMS torque", "N m, N",
        "root mean square of the torques, over time and joints",
    ),
    "torque_max": Metric(
        lambda run: _largest(run.torque), "largest torque", "N m, N", "largest torque of a joint",
    ),
    "saturation": Metric(
        _saturation, "time at a limit", "1",
        "fraction of the time for which the command of a joint is at its limit",
    ),
    "stop_time": Metric(_stop_time, "time at a stop", "s", "time for which a joint is at a stop"),
}  # fmt: skip
"""All metrics by name."""


def check_joints(names: Sequence[str], joints: Sequence[str]) -> None:
    """Reject metrics of joints that an arm does not have.

    Raises:
        InvalidInput: If there is no such joint.
    """
    for name in names:
        joint = name.partition(".")[2]
        if joint and joint not in joints:
            raise InvalidInput(f"study: metric '{name}': allowed joints: {choices(joint, joints)}")


def measured(run: MeasuredRun, names: Sequence[str], joints: Sequence[str]) -> list[float]:
    """Metrics of a run by name."""
    values = []
    for name in names:
        metric, _, joint = name.partition(".")
        values.append(METRICS[metric].of(run.of(joints.index(joint)) if joint else run))
    return values
