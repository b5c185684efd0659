# SPDX-License-Identifier: Apache-2.0
"""What the benchmark asks of a simulator."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchmarks.robots.models import Robot

Vector = np.ndarray
OURS = "arm_sim"  # the family of this suite's own methods
TICK = 1e-3  # [s], over which a controller's torque is held


class Trial(Protocol):
    """One robot in one simulator at one setting; built and reset outside the clock."""

    def reset(self, q: Vector, v: Vector) -> None:
        """Start again from positions [rad] and velocities [rad/s], time zero."""

    def advance(self, duration: float) -> None:
        """Free motion for ``duration`` [s] without torque, by the fastest call there is."""

    def replay(self, torques: Vector) -> None:
        """Run one tick for each row of ``torques`` (ticks, n) [N m], each held for its tick."""

    def state(self) -> tuple[Vector, Vector]:
        """Positions and velocities now."""

    def acceleration(self, q: Vector, v: Vector, tau: Vector) -> Vector:
        """Forward dynamics as this simulator sees it [rad/s²]: is it the same arm?"""


@dataclass(frozen=True)
class Contestant:
    """One method of one simulator."""

    family: str  # the simulator, for colours and for "the best of"
    method: str  # the integrator
    knob: str  # what a setting means: ``"step"`` [s] or ``"tolerance"``
    settings: tuple[float, ...]  # for free motion, from coarse to fine; steps divide a second
    tick_settings: tuple[float, ...]  # for a held torque at 1 kHz; steps divide the tick
    build: Callable[[Robot, float], Trial]  # makes a trial of a robot at a setting
    note: str = ""  # what a reader has to know about its timing

    def __post_init__(self) -> None:
        """Refuse steps that would end a motion elsewhere than where the truth ends."""
        if self.knob == "step":
            steps = [(s, 1.0) for s in self.settings] + [(s, TICK) for s in self.tick_settings]
            for step, whole in steps:
                if abs(whole / step - round(whole / step)) > 1e-9:
                    raise ValueError(f"{self.name}: {step} s does not divide {whole} s")

    @property
    def name(self) -> str:
        return f"{self.family} {self.method}"


def halvings(coarse: float, fine: float) -> tuple[float, ...]:
    """Steps from ``coarse`` down to ``fine`` [s], each half of the one before."""
    count = int(np.floor(np.log2(coarse / fine) + 1e-9)) + 1
    return tuple(coarse / 2**k for k in range(count))


def decades(first: int, last: int) -> tuple[float, ...]:
    """Tolerances 10**first, 10**(first - 1), … down to 10**last."""
    return tuple(10.0**k for k in range(first, last - 1, -1))
