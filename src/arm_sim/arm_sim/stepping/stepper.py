# SPDX-License-Identifier: Apache-2.0
"""The machinery under the simulator: a compiled tick.

It is one step of fixed length, or sub-steps under error control.
"""

from __future__ import annotations

import ctypes
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.codegen.kernel import Kernel, check_forward
from arm_dynamics.dynamics.constrained import check_constrained
from arm_dynamics.dynamics.dynamics import Dynamics
from arm_dynamics.model.arm import Array
from arm_sim.integrators.methods import Method, build_attempt, build_step
from arm_sim.plant.actuation import CompiledControl, actuation
from arm_sim.plant.plant import Plant
from arm_sim.stepping.adaptive import MAX_SUBSTEPS, SubstepControl, controlled_tick, within_reach

NATIVE = Path(__file__).parent / "native"


class Stepper(ABC):
    """Advances a state by whole ticks.

    Attributes:
        kernel: The functions it runs.
        p: Parameters of the plant, shape (np,), to be changed in place.
        tick_operations: Arithmetic operations in one tick (in one sub-step, with error control).
    """

    kernel: Kernel
    p: Array
    tick_operations: int

    @abstractmethod
    def bound(
        self, x: Array, command: Array, trace: Array, effort: Array, errors: Array
    ) -> Callable[[], int]:
        """Make a function of k ticks, to be called as often as one likes.

        Looking up where arrays are takes longer than a tick. All must be contiguous.

        Args:
            x: State of shape (nx,), overwritten by the last good one.
            command: What is commanded, held, or a row for each tick: torques of shape (n,), or a
                compiled controller's references.
            trace: Receives the state after each tick, shape (k, nx).
            effort: Receives the torque that acted in each tick, shape (k, n).
            errors: Receives the estimated error of q after each tick, shape (k,); zeros without
                estimate.

        Returns:
            Function that advances by k ticks, or fewer if a number stops being finite, and says
            how many were good.
        """

    def roll(self, x: Array, command: Array, trace: Array, effort: Array, errors: Array) -> int:
        """Advance once, see ``bound``; return the number of good ticks."""
        return self.bound(x, command, trace, effort, errors)()

    @abstractmethod
    def restart(self) -> None:
        """Forget what was learned from earlier steps."""

    def parameters_at(self, x: Array, u: Array) -> Array:
        """The vector p of the plant's functions at a state under a torque."""
        return self.p


class FixedStepper(Stepper):
    """One step of the method per tick: bounded work, fit for real time."""

    def __init__(
        self,
        plant: Plant,
        method: Method,
        dt: float,
        backend: str,
        control: CompiledControl | None = None,
    ) -> None:
        step = build_step(method, plant.rhs, plant.model.n, plant.project)
        tick = build_tick(step, actuation(plant, control))
        self._dt = np.array([dt])
        driver = driver_source("roll.c", plant, {"TICK": "tick"}, tick)
        self.kernel = Kernel([plant.rhs, tick], backend, driver)
        check_kernel(plant, self.kernel)
        self.p = plant.parameters.nominal
        self.tick_operations = self.kernel.operations("tick")
        self._tick = self.kernel.call("tick")
        self._tick.inputs[3][:] = dt

    def restart(self) -> None:
        """Nothing is remembered between ticks."""

    def bound(
        self, x: Array, command: Array, trace: Array, effort: Array, errors: Array
    ) -> Callable[[], int]:
        """See ``Stepper.bound``."""
        errors[:] = 0.0
        if self.kernel.library is None:
            return partial(self._by_call, x, command, trace, effort)
        return library_function(
            self.kernel, "roll", pointer(x), pointer(command), row_stride(command),
            pointer(self.p), pointer(self._dt), ctypes.c_longlong(len(trace)), pointer(trace),
            pointer(effort),
        )  # fmt: skip

    def _by_call(self, x: Array, command: Array, trace: Array, effort: Array) -> int:
        (x_in, r_in, p_in, _), (after, acted) = self._tick.inputs, self._tick.outputs
        if self.p.size:
            p_in[:] = self.p
        for k in range(len(trace)):
            x_in[:] = x
            r_in[:] = command[k] if command.ndim == 2 else command
            self._tick.run()
            if not within_reach(after):
                return k
            x[:] = after
            trace[k], effort[k] = after, acted
        return len(trace)


class AdaptiveStepper(Stepper):
    """Error-controlled sub-steps inside every tick."""

    def __init__(
        self,
        plant: Plant,
        method: Method,
        dt: float,
        tolerance: float,
        backend: str,
        control: CompiledControl | None = None,
    ) -> None:
        attempt = build_attempt(method, plant.rhs, plant.model.n, plant.scale, plant.project)
        actuate = actuation(plant, control)
        self._dt = dt
        order = {"ORDER": str(method.order), "SUBSTEPS": str(MAX_SUBSTEPS)}
        driver = driver_source("adaptive.c", plant, order, attempt, actuate)
        self.kernel = Kernel([plant.rhs, actuate, attempt], backend, driver)
        check_kernel(plant, self.kernel)
        self.p = plant.parameters.nominal
        self.tick_operations = self.kernel.operations("attempt")
        self._control = SubstepControl(tolerance, method.order)
        self._attempt, self._actuate = self.kernel.call("attempt"), self.kernel.call("actuate")

    def restart(self) -> None:
        """Forget the length of the last sub-step and the error so far."""
        self._control.restart()

    def bound(
        self, x: Array, command: Array, trace: Array, effort: Array, errors: Array
    ) -> Callable[[], int]:
        """See ``Stepper.bound``."""
        if self.kernel.library is None:
            return partial(self._by_call, x, command, trace, effort, errors)
        return library_function(
            self.kernel, "roll_adaptive", pointer(x), pointer(command), row_stride(command),
            pointer(self.p), ctypes.c_double(self._dt), ctypes.c_longlong(len(trace)),
            pointer(trace), pointer(effort), pointer(errors), ctypes.byref(self._control),
        )  # fmt: skip

    def _by_call(
        self, x: Array, command: Array, trace: Array, effort: Array, errors: Array
    ) -> int:
        for k in range(len(trace)):
            acted = self._actuate(x, command[k] if command.ndim == 2 else command)[0]
            if not controlled_tick(self._attempt, x, acted, self.p, self._dt, self._control):
                return k
            trace[k], effort[k], errors[k] = x, acted, self._control.error
        return len(trace)


def build_tick(step: ca.Function, actuate: ca.Function) -> ca.Function:
    """One tick: what acts, then the step. (x, r, p, h) -> (x after, torque that acted)."""
    x, p, h = (ca.MX.sym(name, step.size1_in(i)) for name, i in (("x", 0), ("p", 2), ("h", 3)))
    r = ca.MX.sym("r", actuate.size1_in(1))
    u = actuate(x, r)
    return ca.Function("tick", [x, r, p, h], [step(x, u, p, h), u])


def driver_source(
    file: str, plant: Plant, defines: dict[str, str], *functions: ca.Function
) -> str:
    """C driver with the sizes of this scene and of the functions that it calls."""
    sizes = {
        "NX": plant.nx,
        "NU": plant.model.n,
        "SZ_ARG": max(function.sz_arg() for function in functions) + 8,
        "SZ_RES": max(function.sz_res() for function in functions) + 8,
        "SZ_IW": max(function.sz_iw() for function in functions) + 8,
        "SZ_W": max(function.sz_w() for function in functions) + 8,
    }
    lines = [f"#define {name} {value}" for name, value in {**sizes, **defines}.items()]
    return "\n".join(["", *lines, (NATIVE / file).read_text()])


def row_stride(command: Array) -> ctypes.c_longlong:
    """Numbers from one tick's command to the next one's; 0 for one that is held."""
    return ctypes.c_longlong(command.shape[-1] if command.ndim == 2 else 0)


def library_function(kernel: Kernel, name: str, *arguments: Any) -> Callable[[], int]:
    """A function of the compiled driver with its arguments; it says how many ticks were good."""
    entry = getattr(kernel.library, name)
    entry.restype = ctypes.c_longlong
    # Else ctypes would make these objects in every call, which is half of what a call costs.
    ready = (type(a).from_param(a.value) if hasattr(a, "value") else a for a in arguments)
    call = partial(entry, *ready)
    vars(call)["arguments"] = arguments  # which keep their arrays
    return call


def pointer(array: Array) -> ctypes.c_void_p:
    """Address of an array for a C function; it keeps the array."""
    return array.ctypes.data_as(ctypes.c_void_p)


def check_kernel(plant: Plant, kernel: Kernel) -> None:
    """Hold the kernel's accelerations against Pinocchio before anyone uses them."""
    call, nominal = kernel.call("rhs"), plant.parameters.nominal
    dynamics, n = Dynamics(plant.model), plant.model.n

    def acceleration(q: Array, v: Array, tau: Array) -> Array:
        directions = np.sign(v) if plant.reaction else np.zeros(0)
        p = np.concatenate([nominal, directions])
        x = np.concatenate([q, v, plant.initial(q, v)])
        a = call(x, tau, p)[0][n : 2 * n]
        if plant.torques is None:
            return a
        # What acts is not tau, but what the laws make of it, and bristles are not yet bent.
        acted, law = np.array(plant.torques(x, tau)[1]).ravel(), plant.model.friction
        steady = [law.steady(v, np.sign(v), q, load) for load in (acted, tau)]
        missing = tau - steady[1] - (acted - steady[0] + law.bent(v, np.sign(v)))
        if plant.project is None:
            return a + np.linalg.solve(dynamics.mass_matrix(q), missing)
        still = np.zeros(n)
        both = dynamics.forward(q, still, missing), dynamics.forward(q, still, still)
        return a + both[0] - both[1]

    check = check_forward if plant.project is None else check_constrained
    check(dynamics, acceleration)
