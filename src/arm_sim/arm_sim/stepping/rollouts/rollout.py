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
from arm_sim.stepping.arm_table import ArmTable, Engine, Marks
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.rollouts.batch import Batch
from arm_sim.stepping.rollouts.lane_widths import check_lanes, natural_width, widest
from arm_sim.stepping.rollouts.lanes import (
    ADDRESS,
    NUMBER,
    built_of_lanes,
    has_unmonitored_switches,
    takes_equal_steps,
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
        control: Controller to compile in, if any: for ``side_by_side``.
    """

    def __init__(
        self, plant: Plant, choice: Choice, stepper: Stepper, backend: str,
        control: CompiledControl | None = None,
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._stepper, self._control = plant, choice, stepper, control
        # Away from stops: arms that meet one are advanced once more, alone.
        self._smooth = plant.free or plant
        eventful, controlled = self._smooth.eventful, choice.tolerance is not None
        # With dry friction or contacts, lanes compute the motions without events, and the engine
        # of one arm does the rest; that is not done under error control.
        together = not (eventful and controlled)
        together &= not has_unmonitored_switches(plant)
        self._in_registers = together and backend != "vm"
        self._entry = "controlled_rollout" if controlled and not eventful else "rollout"
        self._equal_steps = takes_equal_steps(plant, choice)
        self._code_of, self._is_compiled = cache(self._built), False
        self._engine = Engine.of(stepper) if eventful else None
        self._idle = list[Stepper]()

    def run(self, batch: Batch, threads: int | None, lanes: int | None) -> Array:
        """Advance a batch; see ``Simulator.rollout``."""
        check_lanes(lanes)
        together = self._in_registers
        if lanes is None and not (self._is_compiled or self._equal_steps):
            together &= len(batch.x0) * batch.steps >= MANY_TICKS
        code, width = widest(lanes, self._code_of) if together else (None, 1)

        marks = Marks(len(batch.x0))

        def work(first: int, last: int) -> None:
            if code is not None:
                self._in_lanes(code, batch, marks, first, last)
            alone = range(first, last) if code is None else marks.of(first, last)
            self._one_by_one(batch, alone, marks)

        share(len(batch.x0), width, threads, work, batch.steps, marks.halt)
        n = self._plant.model.n
        return batch.out[..., : 2 * n] if self._plant.nz else batch.out

    def side_by_side(self, batch: Batch) -> list[int] | None:
        """Advance arms in vector registers on this thread, bit for bit as each alone.

        Returns:
            Arms that come near a stop, or cannot be advanced, and must be advanced one by one;
            None if that holds for all: the scene has dry friction or contacts under error control,
            or there is no compiler.
        """
        code, arms = self.prepare(), len(batch.x0)
        if code is None:
            return None
        marks = Marks(arms)
        work = partial(self._in_lanes, code, batch, marks)
        share(arms, natural_width(), 1, work, batch.steps, marks.halt)
        return marks.of(0, arms)

    def prepare(self) -> Compiled | None:
        """Code for ``side_by_side``, compiled unless that is done; None if there is none."""
        return widest(None, self._code_of)[0] if self._in_registers else None

    def _in_lanes(self, code: Compiled, batch: Batch, marks: Marks, first: int, last: int) -> None:
        """Advance arms side by side; those that would have met a stop are marked."""
        tau = batch.tau[:, : batch.steps]
        arms = ArmTable.of(batch.x0, tau, batch.p, self._choice.dt, marks, self._engine)
        getattr(code.engine, self._entry)(
            code.scene, ctypes.byref(arms), first, last, address(batch.out), batch.out.ndim == 2,
            None if batch.effort is None else address(batch.effort),
        )  # fmt: skip

    def _one_by_one(self, batch: Batch, arms: Sequence[int], marks: Marks) -> None:
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
            ticks = stepper.advance(x, tau, trace, effort, notes, lambda: marks.halted)
            if marks.halted:
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

    def _built(self, width: int) -> Compiled | None:
        """Compiled code that advances so many arms side by side."""
        if width == 1 and (self._choice.tolerance is not None or self._smooth.eventful):
            return None
        types = [ADDRESS, NUMBER, NUMBER, ADDRESS, ctypes.c_int, ADDRESS]
        plant = self._plant if self._smooth.eventful else self._smooth
        write = partial(ticks_of_lanes, plant, self._choice, control=self._control)
        code = built_of_lanes(write, width, self._entry, types)
        self._is_compiled |= code is not None
        return code
