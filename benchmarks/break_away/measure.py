# SPDX-License-Identifier: Apache-2.0
"""Loads at which the simulator and ``Dynamics`` let sets go, and whether the motion obeys."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np

from arm_dynamics import Dynamics, InvalidInput
from arm_dynamics.arrays import Array
from arm_sim import SimulationDiverged, Simulator
from benchmarks.break_away.limits import lacking, limit
from benchmarks.break_away.sets import Set, draw

WITHIN = 1e-6
"""Largest error of a break-away load, relative."""
BISECTIONS = 40
BEYOND = (1.0001, 1.01, 1.3, 2.0)
"""Multiples of the limit at which the motion is checked."""
TICK = 1e-6
"""Length of the tick after which velocities are read as accelerations [s]."""

ROUNDING = 1e-9
"""Accelerations of joints without friction that are rest [m/s² or rad/s²]."""


@dataclass(frozen=True)
class Result:
    """One set.

    Attributes:
        kind: Its family.
        seed: Of its scene.
        limit: Factor of its load at which it gives way, by a linear program.
        error: Of the simulator's factor, relative; infinite if a tick could not be computed.
        of_dynamics: Of that of ``constrained_forward``, likewise; None with contacts.
        lacking: How far motions beyond it are from obeying the laws, relative. Where sliding
            contacts are redundant themselves, several motions obey, and a tick may mix them.
    """

    kind: str
    seed: int
    limit: float
    error: float
    of_dynamics: float | None
    lacking: float

    @property
    def good(self) -> bool:
        """Whether the limits are met, and there is a motion beyond them."""
        return max(self.error, self.of_dynamics or 0.0) <= WITHIN and np.isfinite(self.lacking)


def results(seed: int, loads: int) -> Iterator[Result]:
    """Measure set after set; those that are determinate, jam or do not hold are left out."""
    for scene in count(seed):
        sim: Simulator | None = None
        for each in draw(scene, loads):
            at = limit(each)
            if each.indeterminate and np.isfinite(at):
                sim = sim or Simulator(each.scene, integrator="rk4", dt=TICK)
                yield _measured(each, scene, at, sim)


def _measured(of: Set, seed: int, at: float, sim: Simulator) -> Result:
    order = [of.names.index(name) for name in sim.joint_names]

    def moved(factor: float) -> Array:
        sim.reset(of.q[order])
        v = sim.step((of.base + factor * of.along)[order]).v
        return np.asarray(v[np.argsort(order)])

    try:
        error = _bisected(lambda factor: bool(moved(factor).any()), at)
        back = np.ix_(np.argsort(order), np.argsort(order))
        M = sim.dynamics.mass_matrix(of.q[order])[back]
        off = max(lacking(of, f * at, M, moved(f * at) / TICK) for f in BEYOND)
    except SimulationDiverged:
        error = off = float("inf")
    alone = _of_dynamics(of, at, sim.dynamics, order) if len(of.rows) else None
    return Result(of.kind, seed, at, error, alone, off)


def _of_dynamics(of: Set, at: float, dynamics: Dynamics, order: list[int]) -> float:
    q, still = of.q[order], np.zeros(len(order))

    def moves(factor: float) -> bool:
        tau = (of.base + factor * of.along)[order]
        return bool(abs(dynamics.constrained_forward(q, still, tau)[0]).max() > ROUNDING)

    try:
        return _bisected(moves, at)
    except InvalidInput:
        return float("inf")


def _bisected(moves: Callable[[float], bool], at: float) -> float:
    """Relative error of the factor from which on a set moves, by bisection."""
    low, high = 0.0, 2.0 * at
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if moves(middle) else (middle, high)
    return abs(high - at) / at
