# SPDX-License-Identifier: Apache-2.0
"""What is kept of a run: numbers that say how well it went."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import choices


@dataclass(frozen=True)
class Run:
    """A closed loop of k ticks, of n joints.

    Attributes:
        dt: Length of a tick in [s].
        q: Positions at the ends of ticks, the start included, in [rad] or [m], shape (k+1, n).
        reference: Where they should have been, likewise.
        torque: Torques that acted on the joints in [N m] or [N], shape (k, n).
        command: What was commanded, cut at its limit, shape (k, n).
        limit: Limits of commands, infinite where there is none, shape (n,).
        stops: Positions of the lower and the upper stops, infinite where there is none, (2, n).
    """

    dt: float
    q: Array
    reference: Array
    torque: Array
    command: Array
    limit: Array
    stops: Array

    def of(self, joint: int) -> Run:
        """The same of one joint alone."""
        one = slice(joint, joint + 1)
        return replace(
            self, q=self.q[:, one], reference=self.reference[:, one], torque=self.torque[:, one],
            command=self.command[:, one], limit=self.limit[one], stops=self.stops[:, one],
        )  # fmt: skip


@dataclass(frozen=True)
class Metric:
    """A number of a run.

    Attributes:
        of: Computes it.
        unit: For headings.
        meaning: What it is.
    """

    of: Callable[[Run], float]
    unit: str
    meaning: str


def _error(run: Run) -> Array:
    return run.q - run.reference


def _overshoot(run: Run) -> float:
    """Largest way beyond the goal, of the way there; of joints whose goal is elsewhere."""
    way = run.reference[-1] - run.reference[0]
    moved = way != 0.0
    if not moved.any():
        return 0.0
    beyond = (run.q[:, moved] - run.reference[-1, moved]) / way[moved]
    return float(np.maximum(beyond.max(), 0.0))


def _energy(run: Run) -> float:
    """A torque that is held for a tick does the work τ Δq in it."""
    return float(np.abs(run.torque * np.diff(run.q, axis=0)).sum())


def _stop_time(run: Run) -> float:
    at = (run.q[1:] <= run.stops[0]) | (run.q[1:] >= run.stops[1])
    return float(run.dt * np.count_nonzero(at.any(axis=1)))


def _saturation(run: Run) -> float:
    if not len(run.command):
        return 0.0
    return float((np.abs(run.command) >= run.limit).any(axis=1).mean())


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values))) if values.size else 0.0


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


METRICS: dict[str, Metric] = {
    "tracking_rms": Metric(
        lambda run: _root_mean_square(_error(run)), "rad, m",
        "root mean square of the tracking error, over time and joints",
    ),
    "tracking_max": Metric(
        lambda run: _largest(_error(run)), "rad, m", "largest tracking error of a joint",
    ),
    "final_error": Metric(
        lambda run: _largest(_error(run)[-1]), "rad, m",
        "largest tracking error of a joint at the end",
    ),
    "overshoot": Metric(
        _overshoot, "1", "largest way of a joint beyond its goal, relative to its way there",
    ),
    "energy": Metric(
        _energy, "J", "sum of the work of the drives, driving and braking both counted positive",
    ),
    "torque_rms": Metric(
        lambda run: _root_mean_square(run.torque), "N m, N",
        "root mean square of the torques, over time and joints",
    ),
    "torque_max": Metric(
        lambda run: _largest(run.torque), "N m, N", "largest torque of a joint",
    ),
    "saturation": Metric(
        _saturation, "1", "share of the time in which the command of a joint is at its limit",
    ),
    "stop_time": Metric(_stop_time, "s", "time for which a joint is at a stop"),
}  # fmt: skip
"""All metrics by name."""


def check_metric(name: str) -> None:
    """Refuse what is no metric's name; that of a joint after it is not looked at here.

    Raises:
        ValueError: If there is no such metric.
    """
    metric = name.partition(".")[0]
    if metric not in METRICS:
        raise ValueError(f"no metric is called '{metric}'; allowed: {choices(metric, METRICS)}")


def check_joints(names: Sequence[str], joints: Sequence[str]) -> None:
    """Refuse metrics of joints that an arm does not have.

    Raises:
        ValueError: If there is no such joint.
    """
    for name in names:
        joint = name.partition(".")[2]
        if joint and joint not in joints:
            raise ValueError(f"metric '{name}': allowed joints: {choices(joint, joints)}")


def measured(run: Run, names: Sequence[str], joints: Sequence[str]) -> list[float]:
    """Metrics of a run by name."""
    told = []
    for name in names:
        metric, _, joint = name.partition(".")
        told.append(METRICS[metric].of(run.of(joints.index(joint)) if joint else run))
    return told
