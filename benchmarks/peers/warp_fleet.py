# SPDX-License-Identifier: Apache-2.0
"""Many arms in one world of a simulator on Warp."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import warp

from benchmarks.robots.models import Robot


class World(Protocol):
    """Arms side by side."""

    def reset(self, q: np.ndarray, v: np.ndarray) -> None:
        """Start again from positions and velocities, one row for each arm."""

    def torque(self, tau: np.ndarray) -> None:
        """Torques from now on, one row for each arm."""

    def step(self) -> None:
        """One step of all arms."""

    def states(self) -> tuple[warp.array, warp.array]:
        """Positions and velocities now, arm by arm."""


def fleet_maker(
    world: Callable[[Robot, int, str, float], World], device: str, step: float, steps: int
) -> Callable[[Robot, int], WarpFleet]:
    """A maker of fleets for the studies."""
    return lambda robot, _threads: WarpFleet(
        lambda arms: world(robot, arms, device, step), device, robot.n, steps
    )


class WarpFleet:
    """Worlds by their number of arms, of ``n`` joints each; a call makes ``steps``."""

    def __init__(self, make: Callable[[int], World], device: str, n: int, steps: int) -> None:
        self.make, self.device, self.n, self.steps = make, device, n, steps
        self.worlds: dict[int, tuple[World, warp.array]] = {}

    def __call__(self, q0: np.ndarray, v0: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Positions and velocities after every step, (steps, 2, arms, n)."""
        if len(q0) not in self.worlds:
            shape = (self.steps, 2, len(q0) * self.n)
            kept = warp.empty(shape, dtype=warp.float32, device=self.device)
            self.worlds[len(q0)] = self.make(len(q0)), kept
        world, states = self.worlds[len(q0)]
        world.reset(q0, v0)
        world.torque(tau)
        for k in range(self.steps):
            world.step()
            for which, now in enumerate(world.states()):
                warp.copy(states[k, which], now.flatten())
        return states.numpy().reshape(self.steps, 2, len(q0), self.n)
