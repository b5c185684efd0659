# SPDX-License-Identifier: Apache-2.0
"""Terms as compiled code: of many points, and of one that Python calls without conversions.

All code is verified against Pinocchio before it is used.
"""

from __future__ import annotations

import ctypes
import logging
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation.steady_friction import SteadyFriction
from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel, pointers
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.codegen.python_call import PythonCall, python_call
from arm_dynamics.exceptions import ArmError
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.terms.arm import Expressions, Numbers
from arm_dynamics.terms.table import FIXED, FORWARD, SIZES, Entry
from arm_dynamics.terms.verify import verify

CHUNK = 8192
"""Points that are computed in one call; between calls Python handles signals."""
_DRIVER = compiler.NATIVE / "rows.c"
_log = logging.getLogger(__name__)

type Asked = tuple[Entry, tuple[Any, ...]]
"""An entry, and its arguments that are not numbers."""


def function(
    arm: Expressions, n: int, name: str, asked: Sequence[Asked], fixed: Iterable[str] = FIXED
) -> ca.Function:
    """Entries as one function with dense results, their parts apart.

    Matrices are transposed, since CasADi stores them by columns, and C and NumPy by rows.
    ``fixed`` names arguments that are no arguments of the function, see ``FIXED``.
    """
    wanted = {x for entry, _ in asked for x in entry.of}
    symbols = {x: ca.SX.sym(x, size or n) for x, size in SIZES.items()}
    values = symbols | {x: FIXED[x] * ca.SX.ones(symbols[x].shape) for x in fixed}
    made = list[ca.SX]()
    for entry, which in asked:
        result = entry.formula(arm, *(values[x] for x in entry.of), *which)
        made += ca.vertsplit(result) if entry.fields else [result.T if _square(entry) else result]
    given = [x for x in SIZES if x in wanted and x not in fixed]
    return ca.Function(
        name, [symbols[x] for x in given], [ca.densify(x) for x in made],
        given, [f"o{i}" for i in range(len(made))], {"cse": True},
    )  # fmt: skip


def _square(entry: Entry) -> bool:
    return len(entry.shape) == 2


class Rows:
    """A function of vectors, compiled to be evaluated for many points in one call.

    ``entry`` is the C function ``answer_rows`` of ``rows.c``.

    Raises:
        KernelError: If it cannot be compiled.
        OSError: If there is no disk space for it.
    """

    def __init__(self, function: ca.Function) -> None:
        self._sizes = [function.numel_out(i) for i in range(function.n_out())]
        macros = {
            "POINT": function.name(),
            "ARGUMENTS": function.n_in(),
            "RESULTS": function.n_out(),
            "SIZES": ", ".join(map(str, self._sizes)),
            "SZ_ARG": function.sz_arg() + 1,
            "SZ_RES": function.sz_res() + 1,
            "SZ_IW": function.sz_iw() + 1,
            "SZ_W": function.sz_w() + 1,
        }
        lines = [f"#define {name} {value}" for name, value in macros.items()]
        driver = "\n".join(["", *lines, _DRIVER.read_text(encoding="utf-8")])
        kernel = Kernel([function], "native", driver)
        self.entry = getattr(kernel.library, "answer_rows")  # noqa: B009 - the library's
        self.entry.restype = None

    def __call__(self, *given: Array) -> list[Array]:
        """Each result, shape (k, its size).

        Args:
            given: Arrays of shape (k, …), the first always, or single vectors shared by all.
        """
        count = len(given[0])
        vectors = [_readable(x) for x in given]
        steps = [x.strides[0] // x.itemsize if x.ndim == 2 else 0 for x in vectors]
        made = [np.empty((count, size)) for size in self._sizes]
        strides = (ctypes.c_longlong * len(steps))(*steps)
        for first in range(0, count, CHUNK):
            rows = slice(first, first + CHUNK)
            inputs = [x[rows] if step else x for x, step in zip(vectors, steps, strict=True)]
            some = ctypes.c_longlong(min(CHUNK, count - first))
            outputs = [x[rows] for x in made]
            self.entry(pointers(inputs, len(inputs)), strides, some, pointers(outputs, len(made)))
        return made


def _readable(x: Array) -> Array:
    """The same numbers with contiguous rows; the stride between rows is arbitrary."""
    one_after_the_other = x.strides[-1] == x.itemsize and x.strides[0] % x.itemsize == 0
    return x if one_after_the_other and x.flags.aligned else np.ascontiguousarray(x)


@one_at_a_time
def rows(
    model: ArmModel, friction: SteadyFriction, asked: Sequence[Asked], fixed: Iterable[str] = ()
) -> Rows | None:
    """Compile and verify terms of an arm for batches; ``fixed`` as for ``function``.

    None if there is no code of an entry, or it cannot be compiled, or does not agree with
    Pinocchio to 1e-10 of the size of the summands.
    """
    if not compiler.may_build() or not all(entry.compiles(model) for entry, _ in asked):
        return None
    title = ", ".join(entry.title(*which) for entry, which in asked)
    _log.info("building code for batches: %s of %d joints", title, model.n)
    expressions, numbers = Expressions(model, friction), Numbers(model, friction)
    first = 0
    try:
        made = Rows(point := function(expressions, model.n, "point", asked, fixed))
        for entry, which in asked:
            parts = slice(first, first + max(1, len(entry.fields)))

            def values(given: Mapping[str, Array], parts: slice = parts) -> Array:
                return np.hstack(made(*(given[x] for x in point.name_in()))[parts])

            verify(numbers, (entry, which), values, point.name_in())
            first = parts.stop
    except (ArmError, OSError) as error:
        _log.warning("%s; computed by Pinocchio, which is slower", error)
        return None
    return made


@one_at_a_time
def calls(
    model: ArmModel, friction: SteadyFriction, asked: Sequence[Asked]
) -> dict[Asked, PythonCall]:
    """Compile and verify terms of an arm for single states.

    The acceleration of a joint with dry friction at rest, which may stick, is no number.
    """
    expressions, numbers = Expressions(model, friction), Numbers(model, friction)
    sticks = friction.joints.level > 0.0
    functions = [
        _undecided(function(expressions, model.n, f"{one[0].name}_{i}", [one]), one[0], sticks)
        for i, one in enumerate(asked)
    ]
    kernel = Kernel(functions, "native")
    made = {}
    for (entry, which), each in zip(asked, functions, strict=True):
        shape = each.size_out(0)[::-1] if _square(entry) else (each.numel_out(0),)
        made[entry, which] = call = python_call(kernel, each.name(), shape)
        verify(numbers, (entry, which), _each(call, shape, each.name_in()), each.name_in())
    return made


def _undecided(point: ca.Function, entry: Entry, sticks: NDArray[np.bool_]) -> ca.Function:
    """One result, not finite where it depends on which joints stick."""
    given = point.sx_in()
    made = ca.vertcat(*point.call(given, True, False))
    for joint in np.flatnonzero(sticks).tolist() if entry is FORWARD else ():
        made[joint] += ca.if_else(given[1][joint] == 0, math.nan, 0)
    named = point.name_in(), ["made"]
    return ca.Function(point.name(), given, [ca.densify(made)], *named, {"cse": True})


def _each(call: PythonCall, shape: tuple[int, ...], names: list[str]) -> Callable[..., Array]:
    def values(given: Mapping[str, Array]) -> Array:
        """At many states; NaN where there is no answer."""
        made = [call(*row) for row in zip(*(given[x] for x in names), strict=True)]
        return np.array([np.full(shape, np.nan) if y is None else y for y in made])

    return values
