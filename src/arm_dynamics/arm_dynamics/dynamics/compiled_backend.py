# SPDX-License-Identifier: Apache-2.0
"""Terms of the equation of motion of many points at once, by compiled code.

Pinocchio has checked it, and answers where it cannot be had.
"""

from __future__ import annotations

import ctypes
import logging
from functools import partial

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel, pointers
from arm_dynamics.dynamics import compiled_terms as batch_terms
from arm_dynamics.dynamics.compiled_terms import Answer, BatchTerm
from arm_dynamics.dynamics.pinocchio_backend import Pointwise
from arm_dynamics.dynamics.verify import compare
from arm_dynamics.equations.forward_dynamics import DENSE_AT_MOST
from arm_dynamics.exceptions import KernelError

_DRIVER = compiler.NATIVE / "rows.c"
_log = logging.getLogger(__name__)


class Batches:
    """Answers as those of ``Pointwise``, for batches (k, n); each compiled when first asked for.

    Args:
        points: Answers point by point.
    """

    def __init__(self, points: Pointwise) -> None:
        self._points = points
        self._built: dict[str, Answer] = {}

    def inverse(self, q: Array, v: Array, a: Array, gravity: Array) -> Array:
        """M a + C v + G in [N m] or [N], shape (k, n); ``gravity`` in [m/s²], shape (3,)."""
        return self._of(batch_terms.INVERSE, self._points.inverse)(q, v, a, gravity)

    def forward(self, q: Array, v: Array, tau: Array) -> Array:
        """M⁻¹ (tau - C v - G) in [rad/s²] or [m/s²], shape (k, n); errors of ``Pointwise``."""
        a = self._of(batch_terms.FORWARD, self._points.forward)(q, v, tau)
        lost = ~np.isfinite(a).all(axis=1)
        if lost.any():
            a[lost] = self._points.forward(q[lost], v[lost], tau[lost])  # which says why
        return a

    def mass_matrix(self, q: Array) -> Array:
        """M in [kg m²] or [kg], shape (k, n, n)."""
        return self._of(batch_terms.MASS_MATRIX, self._points.mass_matrix)(q)

    def coriolis_matrix(self, q: Array, v: Array) -> Array:
        """C, with dM/dt - 2 C skew-symmetric, shape (k, n, n)."""
        one_by_one = self._points.coriolis_matrix
        if q.shape[1] > DENSE_AT_MOST:  # an expression of the size of n³
            return one_by_one(q, v)
        return self._of(batch_terms.CORIOLIS_MATRIX, one_by_one)(q, v)

    def gravity(self, q: Array) -> Array:
        """G in [N m] or [N], shape (k, n)."""
        return self._of(batch_terms.GRAVITY, self._points.gravity)(q)

    def energies(self, q: Array, v: Array) -> Array:
        """Kinetic and potential energy in [J], shape (k, 2)."""
        return self._of(batch_terms.ENERGIES, self._points.energies)(q, v)

    def constraint_rows(self, q: Array, v: Array, names: tuple[str, ...]) -> Array:
        """A and γ = Ȧ v of bilateral constraints side by side, shape (k, m, n + 1)."""
        term = batch_terms.constraint_rows(names)
        return self._of(term, partial(self._points.constraint_rows, names=names))(q, v)

    def _of(self, term: BatchTerm, one_by_one: Answer) -> Answer:
        if term.name not in self._built:
            self._built[term.name] = compiled(term, self._points) or one_by_one
        return self._built[term.name]


def compiled(term: BatchTerm, points: Pointwise) -> Answer | None:
    """Compile a term of an arm for batches.

    Args:
        term: Which term.
        points: Answers point by point, to hold the code against.

    Returns:
        A function of batches (k, n), and of vectors that serve every point, which agrees with
        ``points`` to 1e-10 of the size of what is added up; or None where there is no compiled
        code to be had, no space for it, or the code does not agree.
    """
    if not compiler.may_build():
        return None
    _log.info("building code for batches: %s of %d joints", term.title, points.model.n)
    try:
        answer = rows(term.expression(points.model), term.shape(points.model))
        check(term, points, answer)
    except (KernelError, OSError) as error:
        _log.warning("%s; batches are answered by Pinocchio, slower", error)
        return None
    return answer


def check(term: BatchTerm, points: Pointwise, answer: Answer) -> float:
    """Check an answer at random states; returns and errors as those of ``compare``."""
    with np.errstate(all="ignore"):  # numbers that are not finite are refused
        return compare(term.title, *term.compared(points, answer))


def rows(function: ca.Function, shape: tuple[int, ...]) -> Answer:
    """A function of vectors, compiled to be evaluated for many points in one call.

    Args:
        function: Of dense vectors, with one dense result; a matrix transposed, for CasADi's memory
            goes down its columns.
        shape: Shape of the result for people.

    Returns:
        Function of arrays of shape (k, …), the first of them, or of one vector for all points;
        it returns the result for each point, shape (k, …).

    Raises:
        KernelError: If it cannot be compiled.
        OSError: If there is no space for that.
    """
    kernel = Kernel([function], "native", _driver(function))
    entry = getattr(kernel.library, "answer_rows")  # noqa: B009 - the library's, not an attribute
    entry.restype = None

    def answer(*given: Array) -> Array:
        count = len(given[0])
        vectors = [_readable(x) for x in given]
        steps = [x.strides[0] // x.itemsize if x.ndim == 2 else 0 for x in vectors]
        made = np.empty((count, *shape))
        entry(
            pointers(vectors, len(vectors)),
            (ctypes.c_longlong * len(steps))(*steps),
            ctypes.c_longlong(count),
            ctypes.c_void_p(made.ctypes.data),
        )
        return made

    return answer


def _readable(x: Array) -> Array:
    """The same numbers, each row one after the other in memory; rows may be any steps apart."""
    one_after_the_other = x.strides[-1] == x.itemsize and x.strides[0] % x.itemsize == 0
    return x if one_after_the_other and x.flags.aligned else np.ascontiguousarray(x)


def _driver(function: ca.Function) -> str:
    sizes = {
        "POINT": function.name(),
        "ARGUMENTS": function.n_in(),
        "ANSWER": function.numel_out(0),
        "SZ_ARG": function.sz_arg() + 1,
        "SZ_RES": function.sz_res() + 1,
        "SZ_IW": function.sz_iw() + 1,
        "SZ_W": function.sz_w() + 1,
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    return "\n".join(["", *lines, _DRIVER.read_text()])
