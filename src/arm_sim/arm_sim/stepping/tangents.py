# SPDX-License-Identifier: Apache-2.0
"""Derivatives of smooth motion in compiled code.

The coefficients of a derivative are computed once for a step; columns are then propagated through
it, side by side in vector registers. The whole derivative of a tick is computed by rows, with the
transposed function: there are nx of them, and nx + n columns. Code is compiled at the first use;
without a compiler the same functions run on CasADi's virtual machine.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.columns import column_function
from arm_dynamics.codegen.kernel import generate, operations
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.tangents import build_tangent
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import Kept, Slopes
from arm_sim.stepping.rollout import (
    built_of_lanes,
    of_lanes,
    share,
    stop_defines,
    widths,
)
from arm_sim.stepping.stepper import pointer, sizes, source

# Largest number of operations of a step with its derivative that is compiled, in some ten seconds:
# an implicit method needs 520 000 for seven joints.
LONGEST = 600_000


@dataclass(frozen=True)
class Arms:
    """Arms and columns to propagate, and the arrays that receive the results.

    Data shared by arms or ticks are repeated by strides of zero.

    Attributes:
        x: Initial states, shape (b, nx).
        tau: Commands, shape (b, ticks, n).
        p: Parameters, shape (b, np).
        given: Columns of x at the beginning, shape (b, nx, k).
        pushed: Columns of the commands and, below them, of the quantities to differentiate by,
            shape (b, ticks, n + nt, k).
        unit: Whether ``given`` above ``pushed`` is a unit matrix in the first tick.
    """

    x: Array
    tau: Array
    p: Array
    given: Array
    pushed: Array
    unit: bool = False

    @property
    def count(self) -> int:
        """Number of arms."""
        return len(self.x)

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return int(self.tau.shape[1])


@dataclass(frozen=True)
class Carried:
    """Where arms and their columns are after ticks.

    Attributes:
        after: States at the end, shape (b, nx).
        columns: Columns of the states, shape (b, ticks, nx, k), or (b, 1, nx, k) for the last
            tick alone.
    """

    after: Array
    columns: Array

    @classmethod
    def room(cls, arms: Arms, every: bool) -> Carried:
        """Memory for all ticks of arms, or for the last ones."""
        kept = (arms.ticks if every else 1, *arms.given.shape[1:])
        return cls(np.empty(arms.x.shape), np.empty((arms.count, *kept)))

    def by_tick(self, ticks: int) -> Array:
        """The columns by tick; where only the last are kept, each tick overwrites those before."""
        columns = self.columns
        return repeated(columns, (len(columns), ticks, *columns.shape[2:]))


def repeated(array: Array, shape: tuple[int, ...]) -> Array:
    """The array in another shape, repeated by strides of zero."""
    return array if array.shape == shape else np.broadcast_to(array, shape)


class Tangents:
    """Derivatives of steps and ticks of one plant, without events.

    Args:
        plant: The equations.
        choice: Method and tick.
        backend: As for ``Kernel``.
        tuned: Places in p of the quantities to differentiate by.

    Attributes:
        plant: The equations.
    """

    def __init__(
        self, plant: Plant, choice: Choice, backend: str, tuned: Sequence[int] = ()
    ) -> None:
        self.plant, self._choice, self._backend = plant, choice, backend
        self._libraries: dict[int, ctypes.CDLL | None] = {}
        method, scaled, n = choice.method, plant.scaled_jacobian, plant.model.n
        self._advance, self._stretch = build_tangent(
            method, plant.rhs, Slopes(plant, tuned), n, plant.project, scaled, tuned
        )
        self._acting, self._limit = _limits(plant)
        self._held = n + len(tuned)

    def step(self, x: Array, u: Array, p: Array, h: float, columns: Array) -> tuple[Array, Array]:
        """Propagate columns through one step.

        Args:
            x: State, shape (nx,).
            u: Command that acts, shape (n,).
            p: Tunable numbers and modes.
            h: Length of the step in [s].
            columns: Of x, u, the quantities to differentiate by, and h: nx + n + nt + 1 rows, k
                columns.

        Returns:
            The state at the end, and columns of it, shape (nx, k).
        """
        nx = self.plant.nx
        if (library := self.library(1)) is None:
            after, c = self._advance(x, u, p, h)
            moved = self._stretch(c, *np.split(columns, (nx, nx + self._held)))
            return np.array(after).ravel(), np.array(moved)
        x, u, p, columns = (np.ascontiguousarray(array) for array in (x, u, p, columns))
        after, moved, length = np.empty(nx), np.empty((nx, columns.shape[1])), np.array([h])
        library.carry_step(
            pointer(x), pointer(u), pointer(p), pointer(length), pointer(columns),
            ctypes.c_longlong(columns.shape[1]), pointer(after), pointer(moved),
        )  # fmt: skip
        return after, moved

    def ticks(
        self, arms: Arms, found: Carried, threads: int | None, lanes: int | None
    ) -> list[int]:
        """Propagate columns through ticks of many arms, on all cores.

        Args:
            arms: Where they begin.
            found: Where results go.
            threads: Cores to use; None for all.
            lanes: Arms in a vector register; None for the widest there is.

        Returns:
            Arms that may meet a stop; their results are invalid.
        """
        built = ((self.library(width), width) for width in widths(lanes))
        library, width = next(pair for pair in built if pair[0] is not None)
        met, length = (ctypes.c_byte * arms.count)(), np.array([self._choice.dt])
        columns = found.by_tick(arms.ticks)

        def work(first: int, last: int) -> None:
            library.carry_ticks(  # type: ignore[union-attr]
                pointer(arms.x), pointer(arms.tau), *_strides(arms.tau, 2),
                pointer(arms.p), *_strides(arms.p, 1), pointer(length),
                *map(ctypes.c_longlong, (arms.ticks, first, last)),
                pointer(arms.given), *_strides(arms.given, 1),
                pointer(arms.pushed), *_strides(arms.pushed, 2),
                ctypes.c_int(arms.unit), ctypes.c_longlong(arms.given.shape[-1]),
                pointer(found.after),
                pointer(columns), *_strides(columns, 2), ctypes.byref(met),
            )  # fmt: skip

        share(arms.count, width, threads, work)
        return [arm for arm in range(arms.count) if met[arm]]

    @cached_property
    def native(self) -> bool:
        """Whether there is compiled code, which ``ticks`` needs."""
        return self.library(1) is not None

    def library(self, lanes: int) -> ctypes.CDLL | None:
        """Compiled code for ``lanes`` arms side by side; None if it cannot be built."""
        if lanes not in self._libraries:
            self._libraries[lanes] = self._built(lanes)
        return self._libraries[lanes]

    def _built(self, lanes: int) -> ctypes.CDLL | None:
        if self._backend == "vm" or operations(self._advance) > LONGEST:
            return None
        return built_of_lanes(self._source, lanes)

    @cached_property
    def _carry(self) -> ca.Function:
        """As ``stretch``, for steps of constant length."""
        c, dx, dw = (ca.SX.sym(name, self._stretch.size1_in(i)) for i, name in enumerate("cxw"))
        moved = self._stretch(c, dx, dw, 0)
        return ca.Function("carry", [c, dx, dw], [moved], {"cse": True})

    @cached_property
    def _back(self) -> tuple[ca.Function, ca.Function]:
        """Transpose of ``_limit`` and ``_carry``: (all coefficients, λ) -> λ times both.

        For rows of positions and for the others: in an explicit method, the last stage does not
        change positions.
        """
        n, c = self.plant.model.n, self._carry.sx_in(0)
        limits, dx, dr = self._limit.sx_in()
        row, dp = ca.SX.sym("row", dx.shape[0]), ca.SX.sym("dp", self._held - n)
        moved = self._carry(c, dx, ca.vertcat(self._limit(limits, dx, dr), dp))
        coefficients = ca.vertcat(limits, c)

        def of(name: str, part: ca.SX, row: ca.SX) -> ca.Function:
            product = ca.densify(ca.jtimes(part, ca.vertcat(dx, dr, dp), row, True))
            return ca.Function(name, [coefficients, row], [product], {"cse": True})

        return of("back_q", moved[:n], row[:n]), of("back_rest", moved[n:], row[n:])

    def _source(self, lanes: int) -> str:
        functions = [self._advance, self._acting]
        defines = sizes(self.plant, functions) | {
            "ND": str(self._advance.size1_out(1)),
            "NA": str(self._acting.size1_out(1)),
            "NT": str(self._held - self.plant.model.n),
        }
        stops, parts = stop_defines(self.plant)
        columns = [self._carry, self._limit, *self._back]
        if lanes == 1:
            defines["STRETCH"] = "1"
            columns.append(self._stretch)
        text = "\n".join(map(column_function, columns))
        return (
            of_lanes(generate(functions), lanes)
            + source(defines | stops)
            + '\n#include "columns.h"\n'
            + text
            + source({}, *parts, "arms.c", "tangents.c")
        )


def _strides(array: Array, axes: int) -> list[ctypes.c_longlong]:
    """Numbers from one entry to the next along the first axes."""
    return [ctypes.c_longlong(stride // 8) for stride in array.strides[:axes]]


def _limits(plant: Plant) -> tuple[ca.Function, ca.Function]:
    """(x, r) -> command that acts and coefficients c, and (c, dx, dr) -> its change."""
    act, kept = actuation(plant), Kept()
    x, r = ca.SX.sym("x", act.size1_in(0)), ca.SX.sym("r", act.size1_in(1))
    dx, dr = ca.SX.sym("dx", x.shape[0]), ca.SX.sym("dr", r.shape[0])
    u = act(x, r)
    by_x, by_r = (kept.matrix(ca.jacobian(u, by)) for by in (x, r))
    changes = ca.densify(by_x @ dx + by_r @ dr)
    acting = ca.Function("acting", [x, r], [u, kept.values], {"cse": True})
    return acting, ca.Function("limit", [kept.symbols, dx, dr], [changes], {"cse": True})
