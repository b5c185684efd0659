# SPDX-License-Identifier: Apache-2.0
"""Rollouts: many arms at once, in lanes of vector registers and on every core."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import Array, all_finite, real_array, vector
from arm_dynamics.codegen.addresses import address, repeated
from arm_sim.inputs import whole
from arm_sim.integrators.selection import Choice
from arm_sim.memory import refuse_beyond_memory
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.placing import closed_rows, inside_stops
from arm_sim.plant.plant import Plant
from arm_sim.stepping.arm_table import ArmTable, Engine, Marks
from arm_sim.stepping.engine import Compiled
from arm_sim.stepping.lanes import (
    ADDRESS,
    NUMBER,
    built_of_lanes,
    check_lanes,
    has_unmonitored_switches,
    natural_width,
    ticks_of_lanes,
    widest,
)
from arm_sim.stepping.stepper import Stepper
from arm_sim.stepping.threads import share

# Ticks of all arms from which code for error control or events side by side saves more time than
# its compilation takes: up to ten seconds for implicit methods.
MANY_TICKS = 100_000


@dataclass(frozen=True)
class Batch:
    """Arms to advance and where their motion goes.

    Attributes:
        x0: Initial states (q, v, z), shape (b, nx).
        tau: Torques, shape (b, ticks, n); held or shared ones are repeated by strides of zero.
        p: Parameters, shape (b, np).
        steps: Ticks to advance.
        out: States, shape (b, steps + 1, nx), or (b, nx) for the last ones only.
        effort: With a controller, receives what acts in each tick, shape (b, steps, n); ``tau``
            are its references then, shape (b, steps, size).
    """

    x0: Array
    tau: Array
    p: Array
    steps: int
    out: Array
    effort: Array | None = None


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
        # Arms that meet a stop are advanced once more, alone. With dry friction or contacts, lanes
        # compute the motions without events, and the engine of one arm does the rest.
        self._smooth = plant.free or plant
        together = not self._smooth.eventful or choice.tolerance is None
        together &= not has_unmonitored_switches(plant)
        self._in_registers = together and backend != "vm"
        self._controlled = choice.tolerance is not None and not self._smooth.eventful
        self._code_of = cache(self._built)
        self._engine = Engine.of(stepper) if self._smooth.eventful else None
        self._resting: list[Stepper] = []

    def run(self, batch: Batch, threads: int | None, lanes: int | None) -> Array:
        """Advance a batch; see ``Simulator.rollout``."""
        check_lanes(lanes)
        together = self._in_registers
        short = self._choice.tolerance is None and not self._smooth.eventful
        if lanes is None and not (short or self._code_of.cache_info().currsize):
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

    def batch(self, q0: Any, v0: Any, tau: Any, steps: int, p: Array, last_only: bool) -> Batch:
        """Check arguments; ``p`` is of shape (np,) or (b, np)."""
        whole("steps", steps, 0)
        x0 = self.states(p, q0=q0, v0=v0)
        arms, nx = x0.shape
        rows = np.ascontiguousarray(np.broadcast_to(p, (arms, p.shape[-1])))
        if not last_only:
            run = f"a rollout of {arms} arms over {steps} time steps"
            refuse_beyond_memory(arms * (steps + 1), 8 * nx, run, "last_only=True keeps the end")
        out = np.empty((arms, nx) if last_only else (arms, steps + 1, nx))
        return Batch(x0, self.by_tick("tau", tau, arms, steps), rows, int(steps), out)

    def states(self, p: Array, **positions_and_velocities: Any) -> Array:
        """Check positions and velocities, and complete them to states, shape (b, nx).

        Args:
            p: Parameters, shape (np,) or (b, np).
            positions_and_velocities: Each of shape (b, n), by the names of the arguments.
        """
        plant, joints = self._plant, self._plant.model.joint_names
        n, arguments = len(joints), positions_and_velocities
        q, v = (np.atleast_2d(vector(name, x, joints)) for name, x in arguments.items())
        of_q, of_v = arguments
        for name, count in ((of_v, len(v)), ("parameters", len(p) if p.ndim == 2 else len(q))):
            if count != len(q):
                raise InvalidInput(f"{name}: {count} arms, but {of_q} has {len(q)}")
        x = closed_rows(plant, np.concatenate([q, v], axis=1), p)
        if stops := plant.model.stops:
            inside = stops.within(x[:, :n])
            for arm in np.flatnonzero((inside != x[:, :n]).any(axis=1)):
                inside_stops(plant, x[arm, :n], f"arm {arm}: ")  # which refuses all but rounding
            x[:, :n] = inside
        if plant.nz:
            z = [plant.laws.initial(*np.split(row, 2)) for row in x]
            x = np.concatenate([x, np.reshape(z, (len(x), -1))], axis=1)
        return np.ascontiguousarray(x)  # columns of q and v may lie side by side

    def by_tick(self, name: str, values: Any, arms: int, steps: int) -> Array:
        """Check numbers for the joints, of every arm and tick or shared; shape (b, ticks, n)."""
        n = self._plant.model.n
        array = np.ascontiguousarray(real_array(name, values))
        if array.shape not in ((n,), (arms, n), (arms, steps, n)):
            allowed = f"({n},), ({arms}, {n}) or ({arms}, {steps}, {n})"
            axis = f"; {name}[None] adds an axis of arms" * (array.shape == (steps, n))
            raise InvalidInput(f"{name} has shape {array.shape}; expected {allowed}{axis}")
        if not all_finite(array):
            raise InvalidInput(f"{name} has values that are not finite; finite ones are expected")
        if not array.size:  # of no ticks: nothing acts
            array = np.zeros(n)
        by_tick = array if array.ndim == 3 else np.atleast_2d(array)[:, None]
        return repeated(by_tick, (arms, max(1, steps), n))

    def _in_lanes(self, code: Compiled, batch: Batch, marks: Marks, first: int, last: int) -> None:
        """Advance arms side by side; those that would have met a stop are marked."""
        tau = batch.tau[:, : batch.steps]
        arms = ArmTable.of(batch.x0, tau, batch.p, self._choice.dt, marks, self._engine)
        rollout = code.engine.controlled_rollout if self._controlled else code.engine.rollout
        rollout(
            code.scene, ctypes.byref(arms), first, last, address(batch.out), batch.out.ndim == 2,
            None if batch.effort is None else address(batch.effort),
        )  # fmt: skip

    def _one_by_one(self, batch: Batch, arms: Sequence[int], marks: Marks) -> None:
        if not arms:
            return
        stepper = self._at_rest()
        n, nx, steps = self._plant.model.n, self._plant.nx, batch.steps
        trace, effort, notes = np.empty((steps, nx)), np.empty((steps, n)), np.empty((steps, 2))
        for arm in arms:
            stepper.restart()
            stepper.p[:] = batch.p[arm]
            x, tau = batch.x0[arm].copy(), batch.tau[arm]
            tau = np.ascontiguousarray(tau if batch.tau.strides[1] else tau[0])
            ticks = stepper.roll(x, tau, trace, effort, notes, lambda: marks.halted)
            if marks.halted:
                break
            trace[ticks:] = np.nan
            motion = np.vstack([batch.x0[arm], trace])
            batch.out[arm] = motion[-1] if batch.out.ndim == 2 else motion
        self._resting.append(stepper)

    def _at_rest(self) -> Stepper:
        """A stepper that no thread uses."""
        try:
            return self._resting.pop()
        except IndexError:
            return self._stepper.twin()

    def _built(self, width: int) -> Compiled | None:
        """Compiled code that advances so many arms side by side."""
        if width == 1 and (self._choice.tolerance is not None or self._smooth.eventful):
            return None
        name = "controlled_rollout" if self._controlled else "rollout"
        types = [ADDRESS, NUMBER, NUMBER, ADDRESS, ctypes.c_int, ADDRESS]
        plant = self._plant if self._smooth.eventful else self._smooth
        write = partial(ticks_of_lanes, plant, self._choice, control=self._control)
        return built_of_lanes(write, width, name, types)
