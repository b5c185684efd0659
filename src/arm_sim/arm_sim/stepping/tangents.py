# SPDX-License-Identifier: Apache-2.0
"""Derivatives of smooth motion in compiled code.

The coefficients of a derivative are computed once for a step; columns are then propagated through
it, side by side in vector registers. Code is compiled at the first use; without a compiler the
same functions run on CasADi's virtual machine.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.columns import column_function
from arm_dynamics.codegen.kernel import generate, operations
from arm_dynamics.exceptions import CompilerMissing
from arm_sim.integrators.selection import Choice
from arm_sim.integrators.tangents import build_tangent
from arm_sim.plant.actuation import actuation
from arm_sim.plant.plant import Plant
from arm_sim.plant.slopes import Kept, Slopes
from arm_sim.stepping.rollout import (
    natural_width,
    of_lanes,
    share,
    stop_defines,
    widths,
)
from arm_sim.stepping.stepper import pointer, sizes, source

# Largest number of operations of a step with its derivative that is compiled, in a few seconds. An
# implicit method differentiates a Jacobian: a million operations for seven joints.
LONGEST = 300_000


@dataclass(frozen=True)
class Arms:
    """Arms and columns to propagate, and the arrays that receive the results.

    Attributes:
        x: Initial states, shape (b, nx).
        tau: Commands, held, shape (b, n).
        p: Parameters, shape (b, np).
        ticks: Number of ticks.
        given: Columns of (x, tau), shape (nx + n, k) for all arms or (b, nx + n, k).
        after: Receives the states at the end, shape (b, nx).
        columns: Receives their columns, shape (b, nx, k).
    """

    x: Array
    tau: Array
    p: Array
    ticks: int
    given: Array
    after: Array
    columns: Array


class Tangents:
    """Derivatives of steps and ticks of one plant, without events.

    Args:
        plant: The equations.
        choice: Method and tick.
        backend: As for ``Kernel``.

    Attributes:
        plant: The equations.
    """

    def __init__(self, plant: Plant, choice: Choice, backend: str) -> None:
        self.plant, self._choice, self._backend = plant, choice, backend
        self._libraries: dict[int, ctypes.CDLL | None] = {}
        method, scaled, n = choice.method, plant.scaled_jacobian, plant.model.n
        self._advance, self._stretch = build_tangent(
            method, plant.rhs, Slopes(plant), n, plant.project, scaled
        )
        self._acting, self._limit = _limits(plant)

    def step(self, x: Array, u: Array, p: Array, h: float, columns: Array) -> tuple[Array, Array]:
        """Propagate columns through one step.

        Args:
            x: State, shape (nx,).
            u: Command that acts, shape (n,).
            p: Tunable numbers and modes.
            h: Length of the step in [s].
            columns: Of (x, u, h), shape (nx + n + 1, k).

        Returns:
            The state at the end, and columns of it, shape (nx, k).
        """
        nx, n = self.plant.nx, self.plant.model.n
        if (library := self.library(1)) is None:
            after, c = self._advance(x, u, p, h)
            moved = self._stretch(c, *np.split(columns, (nx, nx + n)))
            return np.array(after).ravel(), np.array(moved)
        x, u, p, columns = (np.ascontiguousarray(array) for array in (x, u, p, columns))
        after, moved, length = np.empty(nx), np.empty((nx, columns.shape[1])), np.array([h])
        library.carry_step(
            pointer(x), pointer(u), pointer(p), pointer(length), pointer(columns),
            ctypes.c_longlong(columns.shape[1]), pointer(after), pointer(moved),
        )  # fmt: skip
        return after, moved

    def ticks(self, arms: Arms, threads: int | None, lanes: int | None) -> list[int]:
        """Propagate columns through ticks of many arms, on all cores.

        Args:
            arms: Where they begin, and where results go.
            threads: Cores to use; None for all.
            lanes: Arms in a vector register; None for the widest there is.

        Returns:
            Arms that may meet a stop; their results are invalid.
        """
        built = [(self.library(width), width) for width in widths(lanes)]
        library, width = next(pair for pair in built if pair[0] is not None)
        met = (ctypes.c_byte * len(arms.x))()
        length, count = np.array([self._choice.dt]), arms.given.shape[-1]
        given_arm = 0 if arms.given.ndim == 2 else arms.given[0].size

        def work(first: int, last: int) -> None:
            library.carry_ticks(  # type: ignore[union-attr]
                pointer(arms.x), pointer(arms.tau), pointer(arms.p),
                ctypes.c_longlong(arms.p.strides[0] // 8), pointer(length),
                *map(ctypes.c_longlong, (arms.ticks, first, last)), pointer(arms.given),
                *map(ctypes.c_longlong, (given_arm, count)), pointer(arms.after),
                pointer(arms.columns), ctypes.byref(met),
            )  # fmt: skip

        share(len(arms.x), width, threads, work)
        return [arm for arm in range(len(arms.x)) if met[arm]]

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
        language = "c++" if lanes > 1 else "c"
        if self._backend == "vm" or not compiler.may_build(language):
            return None
        if operations(self._advance) > LONGEST:
            return None
        try:
            return compiler.build(self._source(lanes), language).library
        except CompilerMissing:
            return None

    @cached_property
    def _carry(self) -> ca.Function:
        """As ``stretch``, for steps of constant length."""
        c, dx, du = (ca.SX.sym(name, self._stretch.size1_in(i)) for i, name in enumerate("cxu"))
        moved = self._stretch(c, dx, du, 0)
        return ca.Function("carry", [c, dx, du], [moved], {"cse": True})

    def _source(self, lanes: int) -> str:
        functions = [self._advance, self._acting]
        defines = sizes(self.plant, functions) | {
            "ND": str(self._advance.size1_out(1)),
            "NA": str(self._acting.size1_out(1)),
            "WIDTH": str(1 if lanes > 1 else natural_width()),
        }
        stops, parts = stop_defines(self.plant)
        columns = [self._carry, self._limit]
        if lanes == 1:
            defines["STRETCH"] = "1"
            columns.append(self._stretch)
        text = "\n".join(map(column_function, columns))
        return (
            of_lanes(generate(functions), lanes)
            + source(defines | stops)
            + (_OF_ARMS if lanes > 1 else _OF_COLUMNS)
            + text
            + source({}, *parts, "arms.c", "tangents.c")
        )


_OF_COLUMNS = """
typedef double column __attribute__((vector_size(8 * WIDTH)));
#define SPREAD(x) ((x) - (column){})
"""
_OF_ARMS = """
typedef real column;
#define SPREAD(x) real(x)
"""


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
