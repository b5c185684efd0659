# SPDX-License-Identifier: Apache-2.0
"""Derivatives of ticks of scenes with events, in compiled code; see ``linearization``.

Each event's own functions are generated here, and ``eventful_derivatives.c`` combines them.
"""

import ctypes
from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address
from arm_dynamics.codegen.compiler import HOW_TO_GET_CODE
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.equations.contact import Mode
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.derivatives.guards import guard_functions, guard_names
from arm_sim.derivatives.impact import impact_function
from arm_sim.derivatives.one_sided import TickPoint
from arm_sim.derivatives.resting import resting_functions
from arm_sim.derivatives.tangents import TANGENTS, Tangents
from arm_sim.derivatives.tangents.rest_projection import RestProjection
from arm_sim.exceptions import NotDifferentiable, SimulationDiverged
from arm_sim.integrators.selection import Choice
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant, slope_of_loads
from arm_sim.plant.symbols import dense_function, expanded_function
from arm_sim.stepping.adaptive import SubstepControl
from arm_sim.stepping.engine import NATIVE, Compiled, address_of
from arm_sim.stepping.rollouts.lanes import ADDRESS, compile_lanes, lanes_source

# Mobility across the direction of sliding, relative to the whole, that is rounding.
ROUNDING = 1e-12
# Segments of a tick, and steps of all of them, for which there is room.
MOST_SEGMENTS, MOST_STEPS = 1000, 200_000
# Functions of the engine that derivatives need as well.
ENGINE = ("loads", "statics", "contact_geometry")

_DERIVATIVES = NATIVE / "derivatives"
# Names of ``enum refusal`` by their values
REFUSALS = {value: name for name, value in Header(
    _DERIVATIVES / "sensitivities.h", only="refusal").constants.items()}  # fmt: skip
MESSAGES = {
    "ACCUMULATE": "events accumulate in the time step: it has no derivative",
    "TOO_MANY_STEPS": f"the time step takes more than {MOST_STEPS} sub-steps",
    "BEGINS_WITH_IMPACT": "the time step begins with an impact",
    "BEGINS_ON_BOUNDARY": (
        "{} is on the boundary between two modes at its beginning, as at rest and about to slide"
    ),
    "ENDS_ON_BOUNDARY": "{} is on the boundary between two modes at its end",
    "REDUCED_REBOUND": "the restitution of an impact is reduced so that it adds no energy",
    "IMPACT_ON_EDGE": "the impact at {} is on the boundary of stick and slip",
    "UNLOADED_GEAR": "{} is at rest without load, where its gear's friction vanishes",
    "JOINT_WOULD_GO_ON": (
        "{} is held at rest by a load between its sliding and its static level: if it moved, it "
        "would go on"
    ),
    "CONTACT_WOULD_GO_ON": (
        "{} is held by a load between its sliding and its static level: if it moved, it would "
        "go on"
    ),
    "STARTS_TO_SLIDE": (
        "{} starts to slide, where its direction of sliding is not differentiable"
    ),
    "STOPS_STRAIGHT": (
        "{} comes to rest in a straight line, where its direction of sliding is not differentiable"
    ),
    "SAME_INSTANT": "two events occur at the same instant, or one at the start of the time step",
    "COINCIDE": "{}: events at the same instant",
    "GRAZES": "{} is grazed",
}
# Where a guard grazes that is not known
UNKNOWN = "an event is grazed, or joints and contacts that held together let go"
# Refusals that name a joint by its index, not by that of its guard
OF_JOINTS = ("UNLOADED_GEAR", "JOINT_WOULD_GO_ON")


# Functions from elsewhere: ``helpers_t`` of ``eventful_derivatives.c``
Helpers = Header(_DERIVATIVES / "eventful_derivatives.c", only="helpers_t").structure("helpers_t")
# A traced tick: ``trace_t`` of ``native/modes/tick_record.h``
TickTrace = Header(NATIVE / "modes/tick_record.h", only="trace_t").structure("trace_t")
STEP = ctypes.CFUNCTYPE(None, *[ADDRESS] * 7, ctypes.c_longlong, ADDRESS, ADDRESS)
CLOSE = ctypes.CFUNCTYPE(None, *[ADDRESS] * 4)


def diverged(choice: Choice) -> SimulationDiverged:
    """The error of a tick that cannot be computed."""
    return SimulationDiverged(f"linearize: the time step cannot be computed{choice.remark}")


class EventfulTicks:
    """Derivatives of the ticks of a scene with events.

    Args:
        plant: Its equations.
        choice: Method, tick and tolerance.
        engine: Its compiled engine.
        tangents: Derivatives of its steps.
        tuned: Places in p of the quantities to differentiate by.

    Raises:
        CompilerMissing: Without compiled code.
    """

    @one_at_a_time
    def __init__(
        self, plant: Plant, choice: Choice, engine: Compiled, tangents: Tangents,
        tuned: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self._plant, self._choice, self._tuned = plant, choice, tuned
        self._rest, self._tangents = RestProjection(plant, tuned), tangents
        four, flags = [ADDRESS] * 4, [ctypes.c_int] * 2
        types = [*four, ctypes.c_double, ADDRESS, *flags, *four]
        code = compile_lanes(self._source, 1, "differentiate", types)
        if code is None:
            raise CompilerMissing(
                f"derivatives of scenes with events need compiled code: {HOW_TO_GET_CODE}"
            )
        self._error: BaseException | None = None
        self._code, self._helpers = code, self._callbacks(engine)
        sizes = code.engine.bytes_of_record, code.engine.numbers_recorded
        for size in sizes:
            size.restype = ctypes.c_longlong
        self._records = np.empty((MOST_SEGMENTS, sizes[0]()), np.uint8)
        self._numbers = np.empty((MOST_SEGMENTS, sizes[1](code.scene)))
        self._steps = np.empty(MOST_STEPS)
        rooms = address(self._records), address(self._numbers), address(self._steps)
        self._trace = TickTrace(*rooms, len(self._records), len(self._steps))
        self._guards = guard_names(plant)
        # The number of guards for which a tick is refused, and which they are.
        self._refused = np.zeros(1 + len(self._guards), np.int64)
        self._memory = Lock()

    def tick(
        self, point: TickPoint, control: SubstepControl | None, strict: bool, begins: bool
    ) -> tuple[Array, Array]:
        """State after a tick, shape (nx,), and its derivatives, shape (nx, nx + n + nt).

        Args:
            point: State, command and parameters.
            control: State of the error control, which the tick changes.
            strict: Whether to refuse a tick that begins or ends on the boundary of a mode.
            begins: Whether the state is varied, see ``native/derivatives/rest_stability.h``.

        Raises:
            SimulationDiverged: If the tick cannot be computed.
            NotDifferentiable: If it has no derivative.
        """
        nx = self._plant.nx
        slope = np.empty((nx, nx + self._plant.model.n + len(self._tuned)))
        return self._differentiate(point, control, strict, begins, address(slope)), slope

    def after(self, point: TickPoint, control: SubstepControl | None) -> Array:
        """State after a tick, shape (nx,); the tick changes ``control``."""
        return self._differentiate(point, control, False, False, None)

    def _differentiate(
        self, point: TickPoint, control: SubstepControl | None, strict: bool, begins: bool,
        slope: int | None,
    ) -> Array:  # fmt: skip
        after = np.empty(self._plant.nx)
        x, r, p = (np.ascontiguousarray(array) for array in (point.x, point.r, point.p))
        with self._memory:  # of one tick at a time
            refusal = self._code.engine.differentiate(
                self._code.scene, ctypes.byref(self._helpers), address(x), address(r), address(p),
                self._choice.dt,
                None if control is None else ctypes.byref(control), strict, begins,
                ctypes.byref(self._trace), address(self._refused), address(after), slope,
            )  # fmt: skip
            error, self._error = self._error, None
            if error is not None:
                raise error
            if refusal:
                self._refuse(REFUSALS[refusal])
        return after

    def _refuse(self, reason: str) -> None:
        """Raise the error of a refusal, by its name in C."""
        if reason == "DIVERGES":
            raise diverged(self._choice)
        names, (count, *places) = self._guards, self._refused.tolist()
        if reason in OF_JOINTS:
            names = names[2 * len(self._plant.points) :]
        guards = ", ".join(names[i] for i in places[:count])
        message = UNKNOWN if reason == "GRAZES" and not guards else MESSAGES[reason].format(guards)
        raise NotDifferentiable(f"linearize: {message}; side=1 or side=-1 takes one side of it")

    def _callbacks(self, engine: Compiled) -> ctypes.Structure:
        """Functions of the engine and of steps, and what is evaluated by CasADi."""
        self._kept = (  # must live as long as their addresses
            STEP(self._raising_later(self._step)), CLOSE(self._raising_later(self._close))
        )  # fmt: skip
        step, close = (ctypes.cast(function, ADDRESS).value for function in self._kept)
        steps = self._tangents.library(1)
        if steps is None or self._choice.tolerance is not None:
            return Helpers(engine.scene.value, 0, 0, step, close)
        step = ctypes.cast(steps.engine.propagate_step, ADDRESS).value
        tangents = address_of(steps.own, TANGENTS)
        return Helpers(engine.scene.value, steps.scene.value, tangents, step, close)

    def _raising_later(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback for C, through which no exception passes: ``_differentiate`` raises it."""

        def called(*arguments: int) -> None:
            try:
                callback(*arguments)
            except BaseException as error:
                self._error = self._error or error

        return called

    def _step(
        self, _: int, __: int, x: int, u: int, p: int, h: int, columns: int, count: int,
        after: int, moved: int,
    ) -> None:  # fmt: skip
        """A step whose derivative is too long to be compiled, or taken in parts."""
        plant = self._plant
        nx, n = plant.nx, plant.model.n
        rows = nx + n + len(self._tuned) + 1
        state, changes = self._tangents.step(
            _numbers(x, nx), _numbers(u, n), _numbers(p, plant.rhs.size1_in(2)),
            float(_numbers(h, 1)[0]), _numbers(columns, rows, count),
        )  # fmt: skip
        _numbers(after, nx)[:], _numbers(moved, nx, count)[:] = state, changes

    def _close(self, end: int, p: int, begin: int, slopes: int) -> None:
        """Derivatives of the closing of contacts that a coarse step has left open."""
        n, modes = 2 * self._plant.model.n, self._plant.rhs.size1_in(2)
        arguments = _numbers(end, n), _numbers(p, modes), _numbers(begin, n)
        matrix = np.array(self._rest.closed(*arguments))
        _numbers(slopes, matrix.size)[:] = matrix.ravel(order="F")

    def _source(self, width: int) -> str:
        plant, tuned = self._plant, self._tuned
        functions = [acting(plant), slope_of_loads(plant), *guard_functions(plant, tuned)]
        functions += [function for name, function in plant.events.items() if name in ENGINE]
        functions += resting_functions(plant)
        if plant.layout.directions or plant.points:
            functions += self._rest.matrices()
        if plant.points:
            functions.append(mobility_across(plant))
        if plant.points or plant.model.stops.rigid.any():
            functions.append(impact_function(plant, tuned))
        sizes = {"nt": len(tuned), "ng": len(guard_names(plant))}
        return lanes_source(plant, self._choice, functions, width, sizes)


def acting(plant: Plant) -> ca.Function:
    """CasADi function (x, r) -> command that acts, and its derivatives by x and r."""
    act = actuation(plant)
    x, r = (ca.SX.sym(name, act.size1_in(i)) for i, name in enumerate("xr"))
    u = act(x, r)
    return dense_function("acting", [x, r], u, ca.jacobian(u, x), ca.jacobian(u, r))


def mobility_across(plant: Plant) -> ca.Function:
    """``across`` (x, u, p) -> a number for each contact of a scene.

    It is positive where forces can move the contact across its direction of sliding.
    """
    mobility_of, across = plant.events["contact_mobility"], list[ca.MX]()
    x, u, p = mobility_of.mx_in()
    W, sliding = mobility_of(x, u, p)[0], Mode.of(plant.layout.parts(p)[-1]).direction
    for k in range(len(plant.points)):
        own, along = slice(3 * k, 3 * k + 3), sliding[2 * k : 2 * k + 2]
        lateral = ca.vertcat(0, -along[1], along[0])
        mobility = ca.bilin(W[own, own], lateral, lateral)
        across.append(mobility - ROUNDING * ca.trace(W[own, own]))
    return expanded_function("across", [x, u, p], [ca.vertcat(*across)])


def _numbers(start: int, *shape: int) -> Array:
    """Numbers at an address, row by row."""
    count = int(np.prod(shape))
    memory: Any = (ctypes.c_double * count).from_address(start)
    return np.frombuffer(memory).reshape(shape)
