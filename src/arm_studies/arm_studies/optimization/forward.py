# SPDX-License-Identifier: Apache-2.0
"""Forward pass of iLQR: rollouts of a policy with several step sizes, in parallel by SIMD."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.kernel import generate
from arm_sim.integrators import build_step, build_tick
from arm_sim.plant.actuation import actuation
from arm_sim.simulator import Simulator
from arm_sim.stepping import Stepper
from arm_sim.stepping.rollout import (
    ADDRESS,
    NUMBER,
    alike,
    built_of_lanes,
    marked,
    marks,
    of_lanes,
    stop_defines,
    strides,
    widths,
)
from arm_sim.stepping.stepper import address, sizes, source
from arm_studies.optimization.backward import NATIVE, Policy


@dataclass(frozen=True)
class Course:
    """A trajectory to be improved, with its policy.

    Attributes:
        x: States, shape (nodes, nx).
        u: Commands, shape (nodes, n).
        policy: Change of the commands.
        low: Lower limits of the commands, shape (nodes, n).
        high: Upper limits, likewise.
    """

    x: Array
    u: Array
    policy: Policy
    low: Array
    high: Array


class Forward:
    """Rollouts of one simulator's arm under policies; its own state does not change."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._plant, self._choice = simulator.arm.plant, simulator.choice

    def prepare(self) -> None:
        """Compile what arms side by side need, unless that is done."""
        _ = self._library

    def follow(self, course: Course, size: Array, x: Array, u: Array) -> None:
        """Simulate an arm for each step size.

        Args:
            course: The trajectory and its policy.
            size: Step sizes, shape (b,).
            x: Receives states, shape (b, nodes + 1, nx); the first of each is an input. NaN once
                an arm diverges.
            u: Receives commands, shape (b, nodes, n).
        """
        library, alone = self._library, list(range(len(size)))
        if library is not None:
            alone = self._side_by_side(library, course, size, x, u)
        for arm in alone:
            self._one(course, size[arm], x[arm], u[arm])

    def _side_by_side(
        self, library: ctypes.CDLL, course: Course, size: Array, x: Array, u: Array
    ) -> list[int]:
        """Simulate all arms; those that are returned meet stops and must be simulated alone."""
        policy, met = course.policy, marks(len(size))
        given = [
            np.ascontiguousarray(array)
            for array in (
                course.x, course.u, policy.k, policy.K, course.low, course.high, size,
                self._simulator.arm.parameters, np.array([self._choice.dt]),
            )
        ]  # fmt: skip
        library.follow(
            *map(address, given), len(course.u), len(size),
            address(x), *strides(x, 1), address(u), *strides(u, 1), met,
        )  # fmt: skip
        return marked(met)

    def _one(self, course: Course, size: float, x: Array, u: Array) -> None:
        """Simulate an arm tick by tick through its events, x of shape (nodes + 1, nx)."""
        stepper, policy, now = self._stepper, course.policy, x[0].copy()
        stepper.restart()
        stepper.p[:] = self._simulator.arm.parameters
        trace, effort, notes = np.empty((1, len(now))), np.empty((1, u.shape[1])), np.empty((1, 2))
        x[1:], u[:] = np.nan, np.nan
        for node in range(len(u)):
            wanted = (
                course.u[node] + size * policy.k[node] + policy.K[node] @ (now - course.x[node])
            )
            u[node] = np.clip(wanted, course.low[node], course.high[node])
            if stepper.roll(now, u[node], trace, effort, notes) < 1:
                break
            x[node + 1] = now

    @cached_property
    def _stepper(self) -> Stepper:
        return self._simulator.arm.compiled.stepper.twin()

    @cached_property
    def _library(self) -> ctypes.CDLL | None:
        """Compiled code for the widest registers; None where arms are simulated alone."""
        if self._simulator.arm.compiled.backend == "vm" or not alike(self._plant, self._choice):
            return None
        types = [*[ADDRESS] * 9, NUMBER, NUMBER, ADDRESS, NUMBER, ADDRESS, NUMBER, ADDRESS]
        built = (built_of_lanes(self._source, width, "follow", types) for width in widths(None))
        return next((library for library in built if library is not None), None)

    def _source(self, width: int) -> str:
        plant = self._plant.free or self._plant
        method, scaled = self._choice.method, plant.scaled_jacobian
        step = build_step(method, plant.rhs, plant.model.n, plant.project, scaled)
        tick = build_tick(step, actuation(plant))
        stops = stop_defines(plant)
        defines = sizes(plant, [tick]) | {"TICK": "tick"} | stops
        code = of_lanes(generate([tick]), width)
        code += source(defines, "arms.h", () if stops else ("stops.h",))
        return code + (NATIVE / "forward.c").read_text()
