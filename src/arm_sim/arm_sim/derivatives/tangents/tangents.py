# SPDX-License-Identifier: Apache-2.0
"""Propagation of tangents through steps and ticks, side by side in vector registers.

Code is compiled at the first use; without a compiler the same functions run on CasADi's virtual
machine.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address, pointer, strides
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_sim.derivatives.tangents.functions import TANGENTS, TangentFunctions
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant
from arm_sim.stepping.arm_table import ArmTable, Engine, RolloutFlags
from arm_sim.stepping.engine import NATIVE, Compiled, address_of
from arm_sim.stepping.rollouts.lane_widths import widest
from arm_sim.stepping.rollouts.lanes import ADDRESS, NUMBER, compile_lanes
from arm_sim.stepping.rollouts.threads import share

# Largest change of derivatives, relative to the scene's accuracy, as the parts of a step are
# halved once more: from there on they converge by the method's order.
SETTLED_CHANGE = 0.01
# Rounding of derivatives, relative to the largest
ROUNDING = 1e-13
MAX_HALVINGS = 10


class Columns(ctypes.Structure):
    """Columns of many arms for compiled code: ``columns_t`` of ``tangents.h``."""

    _fields_ = Header(NATIVE / "derivatives/tangents.h", only="columns_t").fields("columns_t")


type Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Arms:
    """Arms and columns to propagate.

    Data shared by arms or ticks are repeated by strides of zero.

    Attributes:
        x: Initial states, shape (b, nx).
        tau: Commands, shape (b, ticks, n).
        p: Parameters, shape (b, np).
        initial: Columns of x at the beginning, shape (b, nx, k).
        held: Columns of the commands and, below them, of the quantities to differentiate by,
            shape (b, ticks, n + nt, k).
    """

    x: Array
    tau: Array
    p: Array
    initial: Array
    held: Array

    @property
    def count(self) -> int:
        """Number of arms."""
        return len(self.x)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return int(self.tau.shape[1])

    def empty_columns(self, every: bool) -> Array:
        """Memory for the columns after every tick, shape (b, ticks, nx, k), or after the last."""
        return np.empty((self.count, self.ticks if every else 1, *self.initial.shape[1:]))


class Tangents:
    """Derivatives of steps and ticks of one plant.

    Of a plant with events only ticks without one are differentiated, in their modes.

    Args:
        plant: The equations.
        choice: Method and tick.
        backend: As for ``Kernel``.
        p_indices: Indices in p of the quantities to differentiate by.
        engine: What finds the modes of a tick in a scene with events; without it, only steps are
            differentiated.

    Attributes:
        plant: The equations.
        engine: What finds the modes of a tick; None if only steps are differentiated.
    """

    @one_at_a_time
    def __init__(
        self, plant: Plant, choice: Choice, backend: str, p_indices: Sequence[int] = (),
        engine: Engine | None = None,
    ) -> None:  # fmt: skip
        self.plant, self._backend, self.engine = plant, backend, engine
        self._choice, ticks = choice, engine is not None and backend != "vm"
        self._functions = TangentFunctions(plant, choice, p_indices, ticks)
        self.library = cache(self._build)
        self._controlled = choice.tolerance is not None
        self._held = plant.model.n + len(p_indices)
        self._unit = np.eye(plant.nx + self._held)

    def step(self, x: Array, u: Array, p: Array, h: float, columns: Array) -> tuple[Array, Array]:
        """Propagate columns through one step; under error control, in parts until they settle.

        That control looks at the state alone: near rest its steps are longer than those whose
        derivatives are accurate, or even stable.

        Args:
            x: State, shape (nx,).
            u: Command that acts, shape (n,).
            p: Tunable numbers and modes.
            h: Length of the step in [s].
            columns: Changes of x, u, the quantities to differentiate by, and h, shape
                (nx + n + nt + 1, k).

        Returns:
            The state at the end, and columns of it, shape (nx, k); NaN if they do not settle.
        """
        after, changes = self._step_once(x, u, p, h, columns)
        if not self._controlled:
            return after, changes
        allowed, finer = columns, changes
        if self.plant.constrained:  # which is what a step without length does
            allowed = np.vstack([self._step_once(x, u, p, 0.0, columns)[1], columns[len(x) :]])
            finer = self._step_once(x, u, p, h, allowed)[1]
        for parts in 2 ** np.arange(1, MAX_HALVINGS + 1):
            coarse, finer = finer, self._step_in_parts(x, u, p, h, allowed, int(parts))
            if self._is_settled(coarse, finer):
                if parts == 2 or allowed is columns:
                    return after, changes if parts == 2 else finer
                return after, self._step_in_parts(x, u, p, h, columns, int(parts))
        return after, np.full_like(changes, np.nan)

    def _is_settled(self, coarse: Array, finer: Array) -> bool:
        tolerance = SETTLED_CHANGE * self.plant.model.scene.sim.accuracy
        with np.errstate(invalid="ignore"):
            error, size = abs(finer - coarse).max(axis=1), abs(finer).max(axis=1)
        return bool((error <= tolerance * size + ROUNDING * size.max()).all())

    def _step_in_parts(
        self, x: Array, u: Array, p: Array, h: float, columns: Array, parts: int
    ) -> Array:
        changes, held = np.split(columns, (self.plant.nx,))
        held = np.vstack([held[:-1], held[-1:] / parts])
        for _ in range(parts):
            x, changes = self._step_once(x, u, p, h / parts, np.vstack([changes, held]))
        return changes

    def _step_once(
        self, x: Array, u: Array, p: Array, h: float, columns: Array
    ) -> tuple[Array, Array]:
        nx = self.plant.nx
        if (code := self.library(1)) is None:
            after, c, *_ = self._functions.step.advance(x, u, p, h)
            changes = self._functions.step.propagate(c, *np.split(columns, (nx, nx + self._held)))
            return np.array(after).ravel(), np.array(changes)
        x, u, p, columns = (np.ascontiguousarray(array) for array in (x, u, p, columns))
        after, changes, length = np.empty(nx), np.empty((nx, columns.shape[1])), np.array([h])
        code.engine.propagate_step(
            code.scene, address_of(code.own, TANGENTS), *map(pointer, (x, u, p, length, columns)),
            ctypes.c_longlong(columns.shape[1]), pointer(after), pointer(changes),
        )  # fmt: skip
        return after, changes

    def differentiate(
        self, x: Array, r: Array, p: Array, ticks: int, threads: int | None, lanes: int | None, *,
        is_first: bool = True,
    ) -> tuple[Array, Array, list[int]]:  # fmt: skip
        """Differentiate ticks of many arms under held commands, on all cores.

        Args:
            x: Initial states, shape (b, nx).
            r: Commands, shape (b, n).
            p: Parameters of all arms, shape (np,).
            ticks: Number of ticks.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            is_first: With events, whether motions begin here, see ``is_unstable_at_rest``.

        Returns:
            States at the end, shape (b, nx), their derivatives by the initial state, the command
            and the quantities side by side, shape (b, nx, nx + n + nt), and the arms whose
            results are invalid: those that may meet a stop, have an event or diverge.
        """
        x, r, dt = np.ascontiguousarray(x), np.ascontiguousarray(r), self._choice.dt
        (count, nx), k, flags = x.shape, len(self._unit), RolloutFlags(len(x))
        after, slopes = np.empty((count, nx)), np.empty((count, nx, k))
        unit = address(self._unit)  # by strides of zero the same for all arms and ticks
        table = ArmTable(address(x), address(r), address(p), r.shape[1], 0, 0, dt, ticks)
        columns = Columns(
            initial=unit, inputs=unit + self._unit[:nx].nbytes, columns=address(slopes),
            columns_arm_stride=nx * k, count=k, starts_from_identity=True,
        )  # fmt: skip
        invalid, _ = self._propagate(table, flags, columns, after, is_first, threads, lanes)
        return after, slopes, invalid

    def propagate(
        self, arms: Arms, threads: int | None, lanes: int | None, *, every: bool,
        is_first: bool = True,
    ) -> tuple[Array, list[int], Array, Counts]:  # fmt: skip
        """Propagate columns through ticks of many arms, on all cores.

        Args:
            arms: Where they begin, and the columns.
            threads: Cores to use; None for all that the work is worth.
            lanes: Arms in a vector register; None for the widest there is.
            every: Whether to return columns after every tick, not only after the last.
            is_first: As for ``differentiate``.

        Returns:
            Columns of the states, shape (b, ticks, nx, k) or (b, 1, nx, k), the arms whose results
            are invalid, see ``differentiate``, the states at the end, and with events the number
            of ticks of each arm before one. Of an arm with an event, alone in its register,
            columns and state are those before it.
        """
        after, columns = np.empty(arms.x.shape), arms.empty_columns(every)
        flags = RolloutFlags(arms.count)
        by_arm, by_tick = strides(columns, 2)
        table = ArmTable.of(arms.x, arms.tau, arms.p, self._choice.dt, flags, None)
        table_of_columns = Columns(
            address(arms.initial), address(arms.held), address(columns), *strides(arms.initial, 1),
            *strides(arms.held, 2), by_arm, by_tick if every else 0, arms.initial.shape[-1], False,
        )  # fmt: skip
        invalid, ticks = self._propagate(
            table, flags, table_of_columns, after, is_first, threads, lanes
        )
        return columns, invalid, after, ticks

    def _propagate(
        self, table: ArmTable, flags: RolloutFlags, columns: Columns, after: Array, is_first: bool,
        threads: int | None, lanes: int | None,
    ) -> tuple[list[int], Counts]:  # fmt: skip
        """Call ``propagate_ticks`` of ``native/derivatives/tangent_ticks.c``.

        Returns:
            The arms whose results are invalid, and with events the ticks of each before one.
        """
        # With events lanes save less time than their compilation takes.
        lanes = 1 if self._functions.event_free and lanes is None else lanes
        code, width = widest(lanes, self.library)
        assert code is not None  # see ``native``
        tangents, propagate_ticks = address_of(code.own, TANGENTS), code.engine.propagate_ticks
        ticks = np.zeros(0 if self.engine is None else len(after), np.int64)
        table.unfinished, table.halted = flags.addresses
        columns.initial_state_varied = is_first
        table.engine = None if self.engine is None else ctypes.addressof(self.engine)
        columns.ticks_before_event, columns.after = ticks.ctypes.data, address(after)

        def work(first: int, last: int) -> None:
            propagate_ticks(
                code.scene, tangents, ctypes.byref(table), first, last, ctypes.byref(columns)
            )

        share(len(after), width, threads, work, table.ticks, flags.halt)
        return flags.marked(0, len(after)), ticks

    @cached_property
    def native(self) -> bool:
        """Whether there is compiled code, which ``differentiate`` and ``propagate`` need."""
        return self.library(1) is not None

    def _build(self, lanes: int) -> Compiled | None:
        """Compiled code for ``lanes`` arms side by side; None if it cannot be built."""
        if self._backend == "vm" or not self._functions.may_be_compiled:
            return None
        types = [ADDRESS, ADDRESS, NUMBER, NUMBER, ADDRESS]
        code = compile_lanes(self._functions.source, lanes, "propagate_ticks", types)
        if code and lanes == 1:
            code.engine.propagate_step.argtypes = [*[ADDRESS] * 7, NUMBER, ADDRESS, ADDRESS]
        return code
