# SPDX-License-Identifier: Apache-2.0
"""Metrics: numbers that summarize a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput, choices


@dataclass(frozen=True)
class RunRecord:
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

    def of(self, joint: int) -> RunRecord:
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
    """

    of: Callable[[RunRecord], float]
    name: str
    unit: str

    @property
    def meaning(self) -> str:
        """Its definition."""
        return (self.of.__doc__ or "").partition("\n")[0]


def _error(run: RunRecord) -> Array:
    return run.q - run.reference


def _tracking_rms(run: RunRecord) -> float:
    """Root mean square of the tracking error, over time and joints."""
    return _root_mean_square(_error(run))


def _tracking_max(run: RunRecord) -> float:
    """Largest tracking error of a joint."""
    return _largest(_error(run))


def _final_error(run: RunRecord) -> float:
    """Largest tracking error of a joint at the end."""
    return _largest(_error(run)[-1])


def _overshoot(run: RunRecord) -> float:
    """Largest overshoot of a joint beyond its goal, relative to its distance from the start.

    Joints whose goal is the start have none.
    """
    distance = run.reference[-1] - run.reference[0]
    moved = distance != 0.0
    if not moved.any():
        return 0.0
    beyond = (run.q[:, moved] - run.reference[-1, moved]) / distance[moved]
    return float(np.maximum(beyond.max(), 0.0))


def _energy(run: RunRecord) -> float:
    """Work of the drives, with driving and braking both counted positive.

    A torque that is constant over a tick does the work τ Δq in it.
    """
    return float(np.abs(run.torque * np.diff(run.q, axis=0)).sum())


def _torque_rms(run: RunRecord) -> float:
    """Root mean square of the torques, over time and joints."""
    return _root_mean_square(run.torque)


def _torque_max(run: RunRecord) -> float:
    """Largest torque of a joint."""
    return _largest(run.torque)


def _saturation(run: RunRecord) -> float:
    """Fraction of the time for which the command of a joint is at its limit."""
    if not len(run.command):
        return 0.0
    return float((np.abs(run.command) >= run.limit).any(axis=1).mean())


def _stop_time(run: RunRecord) -> float:
    """Time for which a joint is at a stop."""
    at_stop = (run.q[1:] <= run.stops[0]) | (run.q[1:] >= run.stops[1])
    return float(run.dt * np.count_nonzero(at_stop.any(axis=1)))


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values))) if values.size else 0.0


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


METRICS: dict[str, Metric] = {
    "tracking_rms": Metric(_tracking_rms, "RMS tracking error", "rad, m"),
    "tracking_max": Metric(_tracking_max, "largest tracking error", "rad, m"),
    "final_error": Metric(_final_error, "error at the end", "rad, m"),
    "overshoot": Metric(_overshoot, "overshoot", "1"),
    "energy": Metric(_energy, "work of the drives", "J"),
    "torque_rms": Metric(_torque_rms, "RMS torque", "N m, N"),
    "torque_max": Metric(_torque_max, "largest torque", "N m, N"),
    "saturation": Metric(_saturation, "time at a limit", "1"),
    "stop_time": Metric(_stop_time, "time at a stop", "s"),
}
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


def evaluate(run: RunRecord, names: Sequence[str], joints: Sequence[str]) -> list[float]:
    """Values of metrics of a run, by their names."""
    values = []
    for name in names:
        metric, _, joint = name.partition(".")
        values.append(METRICS[metric].of(run.of(joints.index(joint)) if joint else run))
    return values
