# SPDX-License-Identifier: Apache-2.0
"""What all ticks with events share: smooth pieces, the instants between them, and the roll.

What an event is, and which mode follows, is for dry friction and for contact to say.
"""

from __future__ import annotations

import ctypes
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial

import casadi as ca
import numpy as np

from arm_dynamics.codegen.kernel import Call, Kernel
from arm_dynamics.model.arm import Array
from arm_sim.integrators.methods import build_attempt, build_step
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import CompiledControl, actuation
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import MAX_SUBSTEPS, SubstepControl, controlled_tick, within_reach
from arm_sim.stepping.stepper import Stepper, driver_source, library_function, pointer, row_stride

BISECTIONS = 200
Driver = Callable[[Plant, Choice, list[ca.Function]], str]


class Flow:
    """Smooth motion over a piece of a tick.

    Args:
        smooth: Kernel function of a step, or of an attempt under error control.
        control: Error control, if any.
    """

    def __init__(self, smooth: Call, control: SubstepControl | None) -> None:
        self._smooth, self._control = smooth, control

    def over(self, x: Array, u: Array, p: Array, h: float) -> Array | None:
        """State after ``h`` with the modes in p held, or None if it cannot be computed."""
        if self._control is not None:
            after = x.copy()
            ok = controlled_tick(self._smooth, after, u, p, h, self._control)
            return after if ok else None
        after = self._smooth(x, u, p, h)[0].copy()
        return after if within_reach(after) else None

    def tried(self, x: Array, u: Array, p: Array, h: float) -> Array | None:
        """The same; error control does not learn from it."""
        kept = None if self._control is None else self._control.kept()
        after = self.over(x, u, p, h)
        if self._control is not None and kept is not None:
            self._control.put_back(kept)
        return after


class EventStepper(Stepper):
    """Event-driven steps; see ``Stepper`` for the interface.

    What follows in Python runs on machines without a compiler; ``native/events.c`` is its twin.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        backend: As for ``Kernel``.
        control: Controller to compile in, if any.
        more: Functions that the events ask for.
        driver: Writes the C driver.

    Attributes:
        memory: What the C driver adds up over ticks, if anything.
    """

    memory: ctypes.Structure | None = None

    def __init__(
        self,
        plant: Plant,
        choice: Choice,
        backend: str,
        control: CompiledControl | None,
        more: Sequence[ca.Function],
        driver: Driver,
    ) -> None:
        smooth = _flow_function(plant, choice)
        functions = [plant.rhs, smooth, actuation(plant, control), *more]
        self.kernel = Kernel(functions, backend, driver(plant, choice, functions))
        self.p = plant.parameters.nominal
        self.tick_operations = self.kernel.operations(smooth.name())
        self._control: SubstepControl | None = None
        if choice.tolerance is not None:
            self._control = SubstepControl(choice.tolerance, choice.method.order)
        self._flow = Flow(self.kernel.call(smooth.name()), self._control)
        self._n, self._dt, self._actuate = plant.model.n, choice.dt, self.kernel.call("actuate")

    @abstractmethod
    def _tick(self, x: Array, u: Array) -> Array | None:
        """State at the end of a tick from x under u, or None if it cannot be computed."""

    def restart(self) -> None:
        """Forget what was learned from earlier steps."""
        if self._control is not None:
            self._control.restart()

    def bound(
        self, x: Array, command: Array, trace: Array, effort: Array, errors: Array
    ) -> Callable[[], int]:
        """See ``Stepper.bound``."""
        if self.kernel.library is None:
            return partial(self._by_call, x, command, trace, effort, errors)
        control = None if self._control is None else ctypes.byref(self._control)
        memory = None if self.memory is None else ctypes.byref(self.memory)
        return library_function(
            self.kernel, "roll_events", pointer(x), pointer(command), row_stride(command),
            pointer(self.p), ctypes.c_double(self._dt), ctypes.c_longlong(len(trace)),
            pointer(trace), pointer(effort), pointer(errors), control, memory,
        )  # fmt: skip

    def _by_call(
        self, x: Array, command: Array, trace: Array, effort: Array, errors: Array
    ) -> int:
        for k in range(len(trace)):
            acted = self._actuate(x, command[k] if command.ndim == 2 else command)[0]
            after = self._tick(x, acted)
            if after is None:
                return k
            x[:] = trace[k] = after
            effort[k] = acted
            errors[k] = self._control.error if self._control is not None else 0.0
        return len(trace)


def event_driver(
    plant: Plant,
    choice: Choice,
    functions: list[ca.Function],
    files: Sequence[str],
    defines: dict[str, str],
) -> str:
    """C source of a driver with events.

    Args:
        plant: The equation of motion.
        choice: Method, tick and tolerance.
        functions: Those that it calls.
        files: Its parts in ``native``, in their order; ``events.c`` among them.
        defines: What they are told.

    Returns:
        The source, with error control before it if the choice has any.
    """
    source = ""
    if choice.tolerance is not None:
        told = {"ORDER": str(choice.method.order), "SUBSTEPS": str(MAX_SUBSTEPS), "ADAPTIVE": "1"}
        source = driver_source("adaptive.c", plant, told, *functions)
    told = {**defines, "NP": str(len(plant.parameters.nominal)), "BISECTIONS": str(BISECTIONS)}
    for file in files:
        source += driver_source(file, plant, told, *functions)
        told = {}
    return source


def first_positive(f: Callable[[float], float], h: float) -> float:
    """Locate a change of ``f`` from not positive to positive on (0, h], to rounding.

    Regula falsi with the weights of Illinois (Dowell, Jarratt, BIT 11, 1971) and a bisection in
    every fourth trial.

    Args:
        f: Continuous; not positive at 0, positive at h.
        h: Right end.

    Returns:
        A time at which f is positive and just before which it is not.
    """
    low, high, f_low, f_high, side = 0.0, h, f(0.0), f(h), 0
    for k in range(BISECTIONS):
        if high - low <= 4e-16 * h:
            break
        secant = high - f_high * (high - low) / (f_high - f_low) if np.isfinite(f_high) else low
        trial = secant if low < secant < high and k % 4 != 3 else 0.5 * (low + high)
        value = f(trial)
        if value > 0.0:
            high, f_high, f_low = trial, value, 0.5 * f_low if side > 0 else f_low
            side = 1
        else:
            low, f_low, f_high = trial, value, 0.5 * f_high if side < 0 else f_high
            side = -1
    return high


def _flow_function(plant: Plant, choice: Choice) -> ca.Function:
    if choice.tolerance is None:
        return build_step(choice.method, plant.rhs, plant.model.n)
    return build_attempt(choice.method, plant.rhs, plant.model.n, plant.scale)
