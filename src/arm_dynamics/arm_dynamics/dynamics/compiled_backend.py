# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion for batches of points, by compiled code.

The code is verified against Pinocchio, which is the fallback where none can be compiled.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel, pointers
from arm_dynamics.codegen.one_at_a_time import one_at_a_time
from arm_dynamics.dynamics.compiled_terms import Answer, BatchTerm
from arm_dynamics.dynamics.verify import compare, random_states
from arm_dynamics.exceptions import KernelError
from arm_dynamics.model.pinocchio_terms import RigidTerms

CHUNK = 8192
"""Points that are computed in one call; between calls Python handles signals."""
_DRIVER = compiler.NATIVE / "rows.c"
_log = logging.getLogger(__name__)


@one_at_a_time
def compiled(term: BatchTerm, points: RigidTerms) -> Answer | None:
    """Compile a term of an arm for batches.

    Args:
        term: Which term.
        points: Pinocchio's terms of the arm, to verify the code against.

    Returns:
        A function of batches (k, n), and of vectors shared by all points, which agrees with
        ``points`` to 1e-10 of the size of the summands; None if code cannot be compiled or stored,
        or does not agree.
    """
    if not compiler.may_build():
        return None
    _log.info("building code for batches: %s of %d joints", term.title, points.robot.n)
    try:
        answer = rows(term.expression(points.robot), term.is_matrix)
        check(term, points, answer)
    except (KernelError, OSError) as error:
        _log.warning("%s; batches are computed by Pinocchio, which is slower", error)
        return None
    return answer


def check(term: BatchTerm, points: RigidTerms, answer: Answer) -> float:
    """Verify results at random states; returns and errors as those of ``compare``."""
    with np.errstate(all="ignore"):  # numbers that are not finite are rejected
        return compare(term.title, *term.compared(points, answer, *random_states(points.robot.n)))


def rows(function: ca.Function, is_matrix: bool) -> Answer:
    """A function of vectors, compiled to be evaluated for many points in one call.

    Args:
        function: Function of dense vectors with one dense result; a matrix is transposed, since
            CasADi stores it by columns.
        is_matrix: Whether the result for a point is a matrix, not a vector.

    Returns:
        Function of arrays of shape (k, …) (the first always) or single vectors shared by all
        points; it returns the result for each point, shape (k, …).

    Raises:
        KernelError: If it cannot be compiled.
        OSError: If there is no disk space for it.
    """
    results = at_points(function, compiled_rows(function))
    shape = function.size_out(0)[::-1] if is_matrix else (function.numel_out(0),)
    return lambda *given: results(*given)[0].reshape(len(given[0]), *shape)


def at_points(function: ca.Function, entry: Any) -> Callable[..., list[Array]]:
    """All results of a function by its ``compiled_rows``, for arrays as of ``rows``."""
    sizes = [function.numel_out(i) for i in range(function.n_out())]

    def answer(*given: Array) -> list[Array]:
        count = len(given[0])
        vectors = [_readable(x) for x in given]
        steps = [x.strides[0] // x.itemsize if x.ndim == 2 else 0 for x in vectors]
        made = [np.empty((count, size)) for size in sizes]
        strides = (ctypes.c_longlong * len(steps))(*steps)
        for first in range(0, count, CHUNK):
            rows = slice(first, first + CHUNK)
            inputs = [x[rows] if step else x for x, step in zip(vectors, steps, strict=True)]
            some = ctypes.c_longlong(min(CHUNK, count - first))
            outputs = [x[rows] for x in made]
            entry(pointers(inputs, len(inputs)), strides, some, pointers(outputs, len(outputs)))
        return made

    return answer


def compiled_rows(function: ca.Function) -> Any:
    """The C function ``answer_rows`` of ``rows.c`` for a function of dense vectors.

    Raises:
        KernelError: If it cannot be compiled.
        OSError: If there is no disk space for it.
    """
    kernel = Kernel([function], "native", _driver(function))
    entry = getattr(kernel.library, "answer_rows")  # noqa: B009 - the library's, not an attribute
    entry.restype = None
    return entry


def _readable(x: Array) -> Array:
    """The same numbers with contiguous rows; the stride between rows is arbitrary."""
    one_after_the_other = x.strides[-1] == x.itemsize and x.strides[0] % x.itemsize == 0
    return x if one_after_the_other and x.flags.aligned else np.ascontiguousarray(x)


def _driver(function: ca.Function) -> str:
    sizes = {
        "POINT": function.name(),
        "ARGUMENTS": function.n_in(),
        "RESULTS": function.n_out(),
        "SIZES": ", ".join(str(function.numel_out(i)) for i in range(function.n_out())),
        "SZ_ARG": function.sz_arg() + 1,
        "SZ_RES": function.sz_res() + 1,
        "SZ_IW": function.sz_iw() + 1,
        "SZ_W": function.sz_w() + 1,
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    return "\n".join(["", *lines, _DRIVER.read_text(encoding="utf-8")])
