# SPDX-License-Identifier: Apache-2.0
"""The compiled tick of the simulator.

A tick is a smooth motion, one step of fixed length or sub-steps under error control, or several of
them between the events of joints that stick and contacts (``native/``). A scene without events
also runs on CasADi's virtual machine.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from copy import copy
from functools import partial

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address, pointer
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import SubstepControl, adaptive_tick, within_reach
from arm_sim.stepping.arm import Arm
from arm_sim.stepping.built_kernel import build_kernel
from arm_sim.stepping.engine import Compiled, library
from arm_sim.stepping.events import EventReport, Trouble
from arm_sim.stepping.reactions import Reactions
from arm_sim.stepping.slices import slices
from arm_sim.stepping.tick_functions import FREE, MOVING

# Arithmetic operations that take some hundredths of a second, and steps in a tick with events
LITTLE_WORK, MANY_STEPS = 20_000_000, 20


class Stepper:
    """Advances a state by whole ticks.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
        control: Controller to compile in, if any.
        acted: Whether commands are torques that acted, for a tick that is replayed.

    Attributes:
        kernel: The functions it runs.
        compiled: Their code with the engine; None on the virtual machine.
        reactions: Modes and reactions at a state.
        p: Tunable quantities, shape (np,), to be changed in place.
        ticks_per_slice: Number of ticks that surely take little time.
        tick_operations: Arithmetic operations in one tick (in one sub-step, with error control).
        moving_operations: The same while all joints slide and nothing touches.
        report: Losses and number of impacts, and why the last tick failed.

    Raises:
        KernelError: If the scene has events and there is no compiled code, or the code disagrees
            with Pinocchio.
    """

    @one_at_a_time
    def __init__(
        self, plant: Plant, choice: Choice, backend: str, control: CompiledControl | None = None,
        *, acted: bool = False,
    ) -> None:  # fmt: skip
        self.kernel = build_kernel(plant, choice, backend, control, acted)
        own = self.kernel.library
        self.compiled = Compiled(own, library()) if own else None
        self.reactions = Reactions(plant, self.kernel, self.compiled)
        self._plant, self._choice = plant, choice
        self._begin()

    def _begin(self) -> None:
        """Prepare what depends on the choice; tunable quantities and the report begin anew."""
        choice, plant = self._choice, self._plant
        self.p = plant.parameters.nominal
        self.report = EventReport()
        self._control: SubstepControl | None = None
        if choice.tolerance is not None:
            self._control = SubstepControl(choice.tolerance, choice.method.order)
        smooth = (FREE if plant.free else "") + ("attempt" if self._control else "step")
        limits = 0 if self._control else self.kernel.operations("actuate")
        first = self.kernel.operations("rhs") if plant.eventful and not plant.free else 0
        tick = self.kernel.operations(smooth) + limits + first
        self.tick_operations = self.moving_operations = tick
        if plant.has_sliding_modes:
            self.moving_operations = self.kernel.operations(f"{MOVING}{smooth}") + limits
        self._smooth, self._actuate = self.kernel.call(smooth), self.kernel.call("actuate")
        steps = MANY_STEPS if plant.eventful or self._control else 1
        self.ticks_per_slice = max(1, LITTLE_WORK // (steps * self.tick_operations + 1))

    def twin(self, choice: Choice | None = None) -> Stepper:
        """Another stepper with the same code, which need not be generated and checked again.

        Args:
            choice: Another length of ticks, or another tolerance where there was one.
        """
        twin = copy(self)
        twin._choice = choice or self._choice
        twin._begin()
        return twin

    def tick_function(
        self, x: Array, command: Array, acted: Array, notes: Array
    ) -> tuple[Callable[[], int], Arm | None]:
        """A function that advances by a tick and can be called repeatedly.

        It avoids looking up array addresses, which takes longer than a tick. Arrays must be
        contiguous.

        Args:
            x: State of shape (nx,), kept if the tick cannot be computed.
            command: Torques, shape (n,), or the reference of a compiled controller.
            acted: Receives the torque that acted, shape (n,).
            notes: Receives the estimated error of q, zero without estimate, and the number of
                ticks time-stepped since the last restart, shape (2,).

        Returns:
            The function, which returns the number of good ticks, 0 or 1; and the same for other
            compiled code, None on the virtual machine.
        """
        if self.compiled is None:
            trace = np.empty((1, len(x)))
            return partial(self._by_call, x, command, trace, acted[None], notes[None]), None
        arm = self._arm(x, command, acted, notes)
        return partial(self.compiled.engine.arm_tick, ctypes.byref(arm)), arm

    def _arm(self, *arrays: Array | None) -> Arm:
        """The arm for compiled code; arrays are state, command, what acted, and notes."""
        assert self.compiled is not None
        control = None if self._control is None else ctypes.addressof(self._control)
        arm = Arm(
            self.compiled.tick, self.compiled.scene.value,
            *(None if array is None else address(array) for array in arrays), address(self.p),
            self._choice.dt, control, ctypes.addressof(self.report),
        )  # fmt: skip
        arm.memory = arrays, self
        return arm

    def ticks_function(
        self, x: Array, command: Array, trace: Array, effort: Array, notes: Array
    ) -> Callable[[], int]:
        """A function that advances by k ticks and can be called repeatedly, as ``tick_function``.

        Args:
            x: State of shape (nx,), overwritten by the last good one.
            command: As for ``tick_function``, or a row for each tick.
            trace: Receives the state after each tick, shape (k, nx).
            effort: Receives the torque that acted in each tick, shape (k, n).
            notes: Receives the notes after each tick, shape (k, 2).

        Returns:
            Function that returns the number of good ticks.
        """
        if self.compiled is None:
            return partial(self._by_call, x, command, trace, effort, notes)
        stride = command.shape[-1] if command.ndim == 2 else 0
        arm, outputs = self._arm(x, None, None, None), (trace, effort, notes)
        entry = self.compiled.engine.arm_ticks
        entry.restype = ctypes.c_longlong
        return partial(
            entry, ctypes.byref(arm), ctypes.c_longlong(len(trace)),
            pointer(command), ctypes.c_longlong(stride), *map(pointer, outputs),
        )  # fmt: skip

    def advance(
        self, x: Array, command: Array, trace: Array, effort: Array, notes: Array,
        halted: Callable[[], bool] = bool,
    ) -> int:  # fmt: skip
        """Advance once, see ``ticks_function``, in slices; return the number of good ticks.

        It ends early when ``halted`` returns true.
        """
        for first, end in slices(len(trace), self.ticks_per_slice):
            if halted():
                return first
            rows = slice(first, end)
            part = command[rows] if command.ndim == 2 else command
            ticks = self.ticks_function(x, part, trace[rows], effort[rows], notes[rows])()
            if ticks < end - first:
                return first + ticks
        return len(trace)

    def advance_each(self, x: Array, command: Array, p: Array, ticks: int) -> tuple[Array, Array]:
        """Advance from each of many states by some ticks, as after a restart.

        Args:
            x: States, shape (k, nx).
            command: Commands, held, shape (k, n).
            p: Tunable quantities, shape (k, np).
            ticks: Number of ticks.

        Returns:
            States after them, shape (k, nx), and energies lost in impacts in [J], shape (k,); NaN
            where a tick cannot be computed.
        """
        self.restart()
        after, lost = np.full_like(x, np.nan), np.full(len(x), np.nan)
        now, held, notes = np.empty(x.shape[1]), np.empty(command.shape[1]), np.empty(2)
        tick, _ = self.tick_function(now, held, np.empty(self._plant.model.n), notes)
        for k in range(len(x)):
            now[:], held[:], self.p[:] = x[k], command[k], p[k]
            before, self.substep = self.report.impact_loss, 0.0
            if all(tick() for _ in range(ticks)):
                after[k], lost[k] = now, self.report.impact_loss - before
        return after, lost

    def restart(self) -> None:
        """Reset the report and the error control."""
        self.report.restart()
        if self._control is not None:
            self._control.restart()

    @property
    def substep(self) -> float:
        """Length of the sub-step to try next in [s]; 0 if unknown or without error control.

        A tick depends only on this, the state and its inputs.
        """
        return 0.0 if self._control is None else self._control.step

    @substep.setter
    def substep(self, length: float) -> None:
        if self._control is not None:
            self._control.step = length

    def actuated(self, x: Array, command: Array) -> Array:
        """Effective command of a tick from a state, of a controller's reference or a command."""
        return self._actuate(x, command)[0].copy()

    def slope(self, x: Array, command: Array) -> tuple[Array, Array]:
        """Slope x' under a command, limits applied, and torques of the drives on the joints."""
        u = self.actuated(x, command)
        rates: Array = self.kernel.call("rhs")(x, u, self.reactions.modes_at(x, u, self.p).p)[0]
        return rates.copy(), self._plant.joint_torque(x, u)

    def _by_call(self, x: Array, command: Array, trace: Array, effort: Array, notes: Array) -> int:
        """Ticks on the virtual machine, see ``ticks_function``."""
        for k in range(len(trace)):
            u = self._actuate(x, command[k] if command.ndim == 2 else command)[0]
            before = x.copy()
            if not self._flow(x, u):
                return k
            if self._plant.model.stops.touched(x[: len(u)]).any():
                x[:], self.report.trouble = before, Trouble.STOP
                return k
            trace[k], effort[k] = x, u
            notes[k] = self._control.error if self._control else 0.0, 0.0
        return len(trace)

    def _flow(self, x: Array, u: Array) -> bool:
        """One smooth tick in place on the virtual machine; returns whether it stayed finite."""
        if self._control is not None:
            return adaptive_tick(self._smooth, x, u, self.p, self._choice.dt, self._control)
        after = self._smooth(x, u, self.p, self._choice.dt)[0]
        if not within_reach(after):
            return False
        x[:] = after
        return True
