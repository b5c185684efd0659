# SPDX-License-Identifier: Apache-2.0
"""Rollouts: many arms at once, in lanes of vector registers and on every core."""

import ctypes
from collections.abc import Sequence
from functools import cache, partial

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.plant import Plant
from arm_sim.stepping.arm_table import ArmTable, Engine, RolloutFlags
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.rollouts.batch import Batch
from arm_sim.stepping.rollouts.equal_steps import has_unmonitored_switches, takes_equal_steps
from arm_sim.stepping.rollouts.lane_widths import check_lanes, natural_width, widest
from arm_sim.stepping.rollouts.lanes import (
    ADDRESS,
    NUMBER,
    compile_lanes,
    ticks_of_lanes,
)
from arm_sim.stepping.rollouts.threads import share
from arm_sim.stepping.stepper import Stepper

# Ticks of all arms from which code for error control or events side by side saves more time than
# its compilation takes: up to ten seconds for implicit methods.
MANY_TICKS = 100_000


class Rollouts:
    """Rollouts of one scene with one method; arms never influence one another.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        stepper: For arms that are advanced alone, without controller; its state does not change.
        backend: As for ``Kernel``.
        control: Controller to compile in, if any: for ``run_in_lanes``.
    """

    def __init__(
        self, plant: Plant, choice: Choice, stepper: Stepper, backend: str,
        control: CompiledControl | None = None,
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._stepper, self._control = plant, choice, stepper, control
        # Away from stops: arms that meet one are advanced once more, alone.
        self._smooth = plant.free or plant
        eventful, adaptive = self._smooth.eventful, choice.tolerance is not None
        # With dry friction or contacts, lanes compute the motions without events, and the engine
        # of one arm does the rest; that is not done under error control.
        suits_lanes = not (eventful and adaptive) and not has_unmonitored_switches(plant)
        self._uses_lanes = suits_lanes and backend != "vm"
        self._entry = "adaptive_rollout" if adaptive and not eventful else "rollout"
        self._equal_steps = takes_equal_steps(plant, choice)
        self._compiled_for_width, self._is_compiled = cache(self._compile), False
        self._engine = Engine.of(stepper) if eventful else None
        self._idle = list[Stepper]()

    def run(self, batch: Batch, threads: int | None, lanes: int | None) -> Array:
        """Advance a batch; see ``Simulator.rollout``."""
        check_lanes(lanes)
        has_code = lanes is not None or self._is_compiled or self._equal_steps
        is_long = len(batch.x0) * batch.steps >= MANY_TICKS
        uses_lanes = self._uses_lanes and (has_code or is_long)
        code, width = widest(lanes, self._compiled_for_width) if uses_lanes else (None, 1)

        flags = RolloutFlags(len(batch.x0))

        def work(first: int, last: int) -> None:
            if code is not None:
                self._advance_in_lanes(code, batch, flags, first, last)
            alone = range(first, last) if code is None else flags.marked(first, last)
            self._advance_alone(batch, alone, flags)

        share(len(batch.x0), width, threads, work, batch.steps, flags.halt)
        return batch.out[..., : 2 * self._plant.model.n] if self._plant.nz else batch.out

    def run_in_lanes(self, batch: Batch) -> list[int] | None:
        """Advance arms in vector registers on this thread, bit for bit as each alone.

        Returns:
            Arms that come near a stop, or cannot be advanced, and must be advanced one by one;
            None if that holds for all: the scene has dry friction or contacts under error control,
            or there is no compiler.
        """
        code, arms = self.prepare(), len(batch.x0)
        if code is None:
            return None
        flags = RolloutFlags(arms)
        work = partial(self._advance_in_lanes, code, batch, flags)
        share(arms, natural_width(), 1, work, batch.steps, flags.halt)
        return flags.marked(0, arms)

    def prepare(self) -> Compiled | None:
        """Code for ``run_in_lanes``, compiled unless that is done; None if there is none."""
        return widest(None, self._compiled_for_width)[0] if self._uses_lanes else None

    def _advance_in_lanes(
        self, code: Compiled, batch: Batch, flags: RolloutFlags, first: int, last: int
    ) -> None:
        """Advance arms in lanes; those that would have met a stop are flagged."""
        tau = batch.tau[:, : batch.steps]
        arms = ArmTable.of(batch.x0, tau, batch.p, self._choice.dt, flags, self._engine)
        getattr(code.engine, self._entry)(
            code.scene, ctypes.byref(arms), first, last, address(batch.out), batch.out.ndim == 2,
            None if batch.effort is None else address(batch.effort),
        )  # fmt: skip

    def _advance_alone(self, batch: Batch, arms: Sequence[int], flags: RolloutFlags) -> None:
        """Advance arms one after another, until they are halted."""
        if not arms:
            return
        stepper = self._idle_stepper()
        n, nx, steps = self._plant.model.n, self._plant.nx, batch.steps
        trace, effort, notes = np.empty((steps, nx)), np.empty((steps, n)), np.empty((steps, 2))
        for arm in arms:
            stepper.restart()
            stepper.p[:] = batch.p[arm]
            x, tau = batch.x0[arm].copy(), batch.tau[arm]
            tau = np.ascontiguousarray(tau if batch.tau.strides[1] else tau[0])
            ticks = stepper.advance(x, tau, trace, effort, notes, lambda: flags.halted)
            if flags.halted:
                break
            trace[ticks:] = np.nan
            motion = np.vstack([batch.x0[arm], trace])
            batch.out[arm] = motion[-1] if batch.out.ndim == 2 else motion
        self._idle.append(stepper)

    def _idle_stepper(self) -> Stepper:
        """A stepper that no thread uses."""
        try:
            return self._idle.pop()
        except IndexError:
            return self._stepper.twin()

    def _compile(self, width: int) -> Compiled | None:
        """Compile code that advances ``width`` arms in lanes; None if there is none."""
        if width == 1 and (self._choice.tolerance is not None or self._smooth.eventful):
            return None
        types = [ADDRESS, NUMBER, NUMBER, ADDRESS, ctypes.c_int, ADDRESS]
        plant = self._plant if self._smooth.eventful else self._smooth
        write = partial(ticks_of_lanes, plant, self._choice, control=self._control)
        code = compile_lanes(write, width, self._entry, types)
        self._is_compiled = self._is_compiled or code is not None
        return code
