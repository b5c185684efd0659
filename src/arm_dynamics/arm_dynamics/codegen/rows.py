# SPDX-License-Identifier: Apache-2.0
"""Generated functions that are evaluated for many points in one call."""

import ctypes

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel, pointers

# Points that are computed in one call; between calls Python handles signals
CHUNK = 8192
_DRIVER = compiler.NATIVE / "rows.c"


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

    def __call__(self, *arguments: Array) -> list[Array]:
        """Each result, shape (k, its size).

        Args:
            arguments: Arrays of shape (k, …), the first always, or single vectors shared by all.
        """
        count = len(arguments[0])
        vectors = [_contiguous_rows(x) for x in arguments]
        steps = [x.strides[0] // x.itemsize if x.ndim == 2 else 0 for x in vectors]
        results = [np.empty((count, size)) for size in self._sizes]
        strides = (ctypes.c_longlong * len(steps))(*steps)
        for first in range(0, count, CHUNK):
            chunk = slice(first, first + CHUNK)
            inputs = [x[chunk] if step else x for x, step in zip(vectors, steps, strict=True)]
            outputs = [x[chunk] for x in results]
            length = ctypes.c_longlong(min(CHUNK, count - first))
            targets = pointers(outputs, len(outputs))
            self.entry(pointers(inputs, len(inputs)), strides, length, targets)
        return results


def _contiguous_rows(x: Array) -> Array:
    """The numbers of an array with contiguous rows; the stride between rows is arbitrary."""
    contiguous = x.strides[-1] == x.itemsize and x.strides[0] % x.itemsize == 0
    return x if contiguous and x.flags.aligned else np.ascontiguousarray(x)
