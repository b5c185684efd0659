# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks with events, in compiled code; see ``linearization``.

Each event's own functions are generated here, and ``eventful_derivatives.c`` combines them.
"""

import ctypes
from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.derivatives.guards import guard_functions, guard_names, mobility_across
from arm_sim.derivatives.impact import impact_function
from arm_sim.derivatives.one_sided import TickPoint
from arm_sim.derivatives.refusals import (
    JOINT_REASONS,
    MAX_STEPS,
    REASONS,
    divergence,
    refusal_message,
)
from arm_sim.derivatives.rest_stability import rest_functions
from arm_sim.derivatives.tangents import TANGENTS, Tangents
from arm_sim.derivatives.tangents.rest_projection import RestProjection
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import actuation_slopes
from arm_sim.plant.plant import Plant, slope_of_loads
from arm_sim.stepping.adaptive import SubstepControl
from arm_sim.stepping.engine import NATIVE, Compiled, address_of
from arm_sim.stepping.rollouts.lanes import ADDRESS, compile_lanes, lanes_source

# Largest number of segments of a tick
MAX_SEGMENTS = 1000
# Functions of the engine that derivatives need as well
ENGINE_FUNCTIONS = ("loads", "statics", "contact_geometry")

_DERIVATIVES = NATIVE / "derivatives"
# Functions that derivatives call back: ``helpers_t`` of ``eventful_derivatives.c``
Helpers = Header(_DERIVATIVES / "eventful_derivatives.c", only="helpers_t").structure("helpers_t")
# A traced tick: ``trace_t`` of ``native/modes/tick_record.h``
TickTrace = Header(NATIVE / "modes/tick_record.h", only="trace_t").structure("trace_t")
# The two callbacks to Python among them
STEP = ctypes.CFUNCTYPE(None, *[ADDRESS] * 7, ctypes.c_longlong, ADDRESS, ADDRESS)
CLOSE = ctypes.CFUNCTYPE(None, *[ADDRESS] * 4)


class EventfulTicks:
    """Derivatives of the ticks of a scene with events.

    Args:
        plant: The scene's equations.
        choice: Method, tick and tolerance.
        engine: The scene's compiled engine.
        tangents: Derivatives of the scene's steps.
        p_indices: Indices in p of the quantities to differentiate by.

    Raises:
        CompilerMissing: Without compiled code.
    """

    @one_at_a_time
    def __init__(
        self, plant: Plant, choice: Choice, engine: Compiled, tangents: Tangents,
        p_indices: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._p_indices = plant, choice, p_indices
        self._rest, self._tangents = RestProjection(plant, p_indices), tangents
        four, flags = [ADDRESS] * 4, [ctypes.c_int] * 2
        types = [*four, ctypes.c_double, ADDRESS, *flags, *four]
        code = compile_lanes(self._source, 1, "differentiate", types)
        if code is None:
            raise CompilerMissing(
                f"derivatives of scenes with events need compiled code: {HOW_TO_GET_CODE}"
            )
        self._error: BaseException | None = None
        self._callbacks_alive = (  # must live as long as their addresses
            STEP(self._raising_later(self._step)), CLOSE(self._raising_later(self._close))
        )  # fmt: skip
        self._code, self._helpers = code, self._helper_functions(engine)
        sizes = code.engine.bytes_of_record, code.engine.numbers_recorded
        for size in sizes:
            size.restype = ctypes.c_longlong
        self._records = np.empty((MAX_SEGMENTS, sizes[0]()), np.uint8)
        self._numbers = np.empty((MAX_SEGMENTS, sizes[1](code.scene)))
        self._steps = np.empty(MAX_STEPS)
        buffers = address(self._records), address(self._numbers), address(self._steps)
        self._trace = TickTrace(*buffers, len(self._records), len(self._steps))
        self._guards = guard_names(plant)
        # How many guards or joints a refusal concerns, and their indices
        self._subjects = np.zeros(1 + len(self._guards), np.int64)
        self._lock = Lock()

    def tick(
        self, point: TickPoint, control: SubstepControl | None, *, strict: bool, is_first: bool
    ) -> tuple[Array, Array]:
        """State after a tick, shape (nx,), and its derivatives, shape (nx, nx + n + nt).

        Args:
            point: State, command and parameters.
            control: State of the error control, which the tick changes.
            strict: Whether to refuse a tick that begins or ends on the boundary of a mode.
            is_first: Whether it is the first tick of a motion, see ``is_unstable_at_rest``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        nx = self._plant.nx
        slope = np.empty((nx, nx + self._plant.model.n + len(self._p_indices)))
        after = self._run(point, control, address(slope), strict=strict, is_first=is_first)
        return after, slope

    def advance(self, point: TickPoint, control: SubstepControl | None) -> Array:
        """State after a tick, shape (nx,); the tick changes ``control``."""
        return self._run(point, control, None, strict=False, is_first=False)

    def _run(
        self, point: TickPoint, control: SubstepControl | None, slope: int | None, *, strict: bool,
        is_first: bool,
    ) -> Array:  # fmt: skip
        """State after a tick, whose derivatives are written to the address ``slope``, if any."""
        after = np.empty(self._plant.nx)
        x, r, p = (np.ascontiguousarray(array) for array in (point.x, point.r, point.p))
        with self._lock:  # the memory is that of one tick
            refusal = self._code.engine.differentiate(
                self._code.scene, ctypes.byref(self._helpers), address(x), address(r), address(p),
                self._choice.dt,
                None if control is None else ctypes.byref(control), strict, is_first,
                ctypes.byref(self._trace), address(self._subjects), address(after), slope,
            )  # fmt: skip
            error, self._error = self._error, None
            if error is not None:
                raise error
            if refusal:
                raise self._error_of(REASONS[refusal])
        return after

    def _error_of(self, reason: str) -> SimulationDiverged | NotDifferentiable:
        """The error of a refused tick, by the name of the reason in C."""
        if reason == "DIVERGES":
            return divergence(self._choice)
        names, (count, *indices) = self._guards, self._subjects.tolist()
        if reason in JOINT_REASONS:  # guards of joints follow two of each contact
            names = names[2 * len(self._plant.points) :]
        return NotDifferentiable(refusal_message(reason, names, indices[:count]))

    def _helper_functions(self, engine: Compiled) -> ctypes.Structure:
        """Functions of the engine and of steps, and what is evaluated by CasADi."""
        step, close = (ctypes.cast(callback, ADDRESS).value for callback in self._callbacks_alive)
        steps = self._tangents.library(1)
        if steps is None or self._choice.tolerance is not None:
            return Helpers(
                tick_scene=engine.scene.value, propagate_step=step, differentiate_closing=close
            )
        step = ctypes.cast(steps.engine.propagate_step, ADDRESS).value
        tangents = address_of(steps.own, TANGENTS)
        return Helpers(
            tick_scene=engine.scene.value, step_scene=steps.scene.value, tangents=tangents,
            propagate_step=step, differentiate_closing=close,
        )  # fmt: skip

    def _raising_later(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback for C, through which no exception passes: ``_run`` raises it."""

        def call(*arguments: int) -> None:
            try:
                callback(*arguments)
            except BaseException as error:
                self._error = self._error or error

        return call

    def _step(
        self, _: int, __: int, x: int, u: int, p: int, h: int, columns: int, count: int,
        after: int, columns_after: int,
    ) -> None:  # fmt: skip
        """Step with a derivative that is too long to be compiled, or is taken in parts."""
        plant = self._plant
        nx, n = plant.nx, plant.model.n
        rows = nx + n + len(self._p_indices) + 1
        x_after, changes = self._tangents.step(
            _numbers(x, nx), _numbers(u, n), _numbers(p, plant.rhs.size1_in(2)),
            float(_numbers(h, 1)[0]), _numbers(columns, rows, count),
        )  # fmt: skip
        _numbers(after, nx)[:], _numbers(columns_after, nx, count)[:] = x_after, changes

    def _close(self, end: int, p: int, begin: int, slopes: int) -> None:
        """Derivatives of the closing of contacts that a coarse step has left open."""
        moving, modes = 2 * self._plant.model.n, self._plant.rhs.size1_in(2)
        arguments = _numbers(end, moving), _numbers(p, modes), _numbers(begin, moving)
        matrix = np.array(self._rest.closed(*arguments))
        _numbers(slopes, matrix.size)[:] = matrix.ravel(order="F")

    def _source(self, width: int) -> str:
        plant, p_indices = self._plant, self._p_indices
        functions = [actuation_slopes(plant), slope_of_loads(plant)]
        functions += [
            function for name, function in plant.events.items() if name in ENGINE_FUNCTIONS
        ]
        functions += [*guard_functions(plant, p_indices), *rest_functions(plant)]
        if plant.layout.directions or plant.points:
            functions += self._rest.matrices()
        if plant.points:
            functions.append(mobility_across(plant))
        if plant.points or plant.model.stops.rigid.any():
            functions.append(impact_function(plant, p_indices))
        sizes = {"nt": len(p_indices), "ng": len(guard_names(plant))}
        return lanes_source(plant, self._choice, functions, width, sizes)


def _numbers(start: int, *shape: int) -> Array:
    """Numbers at an address, row by row."""
    count = int(np.prod(shape))
    memory: Any = (ctypes.c_double * count).from_address(start)
    return np.frombuffer(memory).reshape(shape)
