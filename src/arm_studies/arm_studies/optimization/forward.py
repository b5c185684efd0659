# SPDX-License-Identifier: Apache-2.0
"""Forward pass of iLQR: rollouts of a policy with several step sizes, in parallel by SIMD."""

import ctypes
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address, strides
from arm_sim.simulation.simulator import Simulator
from arm_sim.stepping import Stepper
from arm_sim.stepping.arm_table import ArmTable, Engine, RolloutFlags
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.rollouts import lanes
from arm_sim.stepping.rollouts.equal_steps import has_unmonitored_switches
from arm_sim.stepping.rollouts.lane_widths import widest
from arm_studies.optimization.backward import INCLUDE_FLAGS, Policy


@dataclass(frozen=True)
class Baseline:
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
    """Rollouts of one simulator's arm under policies; its own state does not change.

    Attributes:
        eventful: Whether ticks of arms in lanes may have events.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._plant, self._choice = simulator.arm.plant, simulator.choice
        # The equations in lanes: away from stops, if those are all that causes events.
        self._ticking = self._plant.free or self._plant
        self.eventful = self._ticking.eventful

    def prepare(self) -> None:
        """Compile what arms side by side need, unless that is done."""
        _ = self._library

    def follow(self, baseline: Baseline, size: Array, x: Array, u: Array) -> None:
        """Simulate an arm for each step size.

        Args:
            baseline: The trajectory and its policy.
            size: Step sizes, shape (b,).
            x: Receives states, shape (b, nodes + 1, nx); the first of each is an input. NaN once
                an arm diverges.
            u: Receives commands, shape (b, nodes, n).
        """
        code, alone = self._library, list(range(len(size)))
        if code is not None:
            alone = self._side_by_side(code, baseline, size, x, u)
        for arm in alone:
            self._follow_alone(baseline, size[arm], x[arm], u[arm])

    def _side_by_side(
        self, code: Compiled, baseline: Baseline, size: Array, x: Array, u: Array
    ) -> list[int]:
        """Simulate all arms; those that are returned meet stops and must be simulated alone."""
        policy, flags = baseline.policy, RolloutFlags(len(size))
        arrays = baseline.x, baseline.u, policy.k, policy.K, baseline.low, baseline.high, size
        inputs, shared = [*map(np.ascontiguousarray, arrays)], self._simulator.arm.parameters
        p = np.broadcast_to(shared, (len(size), len(shared)))
        arms = ArmTable.of(x, u, p, self._choice.dt, flags, self._engine)
        code.engine.ilqr_follow(
            code.scene, ctypes.byref(arms), len(size), *map(address, inputs),
            address(x), *strides(x, 1), address(u), *strides(u, 1),
        )  # fmt: skip
        return flags.marked(0, len(size))

    def _follow_alone(self, baseline: Baseline, size: float, x: Array, u: Array) -> None:
        """Simulate an arm tick by tick through its events, x of shape (nodes + 1, nx)."""
        stepper, policy, now = self._stepper, baseline.policy, x[0].copy()
        stepper.restart()
        stepper.p[:] = self._simulator.arm.parameters
        trace, effort, notes = np.empty((1, len(now))), np.empty((1, u.shape[1])), np.empty((1, 2))
        x[1:], u[:] = np.nan, np.nan
        for node in range(len(u)):
            feedback = policy.K[node] @ (now - baseline.x[node])
            command = baseline.u[node] + size * policy.k[node] + feedback
            u[node] = np.clip(command, baseline.low[node], baseline.high[node])
            if stepper.advance(now, u[node], trace, effort, notes) < 1:
                break
            x[node + 1] = now

    @cached_property
    def _stepper(self) -> Stepper:
        return self._simulator.arm.compiled.stepper.twin()

    @cached_property
    def _engine(self) -> Engine | None:
        """In a scene with events, what arms in lanes ask; it has its own memory."""
        return Engine.of(self._stepper) if self.eventful else None

    @cached_property
    def _library(self) -> Compiled | None:
        """Compiled code, for many lanes without events; None where Python steps arms alone."""
        alone = self._choice.tolerance is not None or has_unmonitored_switches(self._plant)
        if alone or self._simulator.arm.compiled.backend == "vm":
            return None
        array, number = lanes.ADDRESS, lanes.NUMBER
        types = [array, number, *[array] * 8, number, array, number]
        write, unit = partial(lanes.ticks_of_lanes, self._ticking, self._choice), ("forward.c",)
        build = partial(lanes.compile_lanes, write, name="ilqr_follow", types=types, units=unit)
        return widest(1 if self.eventful else None, partial(build, folders=INCLUDE_FLAGS))[0]
