# SPDX-License-Identifier: Apache-2.0
"""From an expression to a function that runs.

It runs as native code, or on CasADi's virtual machine where there is no compiler.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.split_functions import divided
from arm_dynamics.exceptions import CompilerMissing, InvalidInput, KernelError

BACKENDS = ("auto", "native", "vm")
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Call:
    """A function bound to memory of its own: write ``inputs``, call ``run``, read ``outputs``.

    Two threads must not use one instance at once.

    Attributes:
        inputs: One array per argument, to be written in place.
        outputs: One array per result, overwritten by each call.
        run: The function itself.
    """

    inputs: tuple[Array, ...]
    outputs: tuple[Array, ...]
    run: Callable[[], object]

    def __call__(self, *values: Array | float) -> tuple[Array, ...]:
        """Copy ``values`` into the inputs, run, and return the (reused) outputs."""
        for place, value in zip(self.inputs, values, strict=True):
            place[...] = value
        self.run()
        return self.outputs


class Kernel:
    """Functions of one scene, compiled together.

    Args:
        functions: CasADi functions with dense arguments and results and distinct names.
        backend: ``native`` (a C compiler is needed), ``vm`` (CasADi's virtual machine), or
            ``auto``: the first that can be had.
        driver: C source that may call the functions, compiled with them.
        needs_native: What of the scene cannot run on the virtual machine, for example "dry
            friction"; nothing if it is empty.

    Raises:
        InvalidInput: If the backend is unknown.
        KernelError: If native code is demanded, or needed, and cannot be had; it says how to get
            it.
    """

    def __init__(
        self,
        functions: Sequence[ca.Function],
        backend: str = "auto",
        driver: str = "",
        needs_native: str = "",
    ) -> None:
        if backend not in BACKENDS:
            raise InvalidInput(f"backend = {backend!r}; allowed: {', '.join(BACKENDS)}")
        self._functions = {function.name(): function for function in functions}
        self.library: ctypes.CDLL | None = None
        self.backend = "virtual machine of CasADi"
        if backend != "vm":
            self._compile(backend, driver, needs_native)
        elif needs_native:
            raise KernelError(
                f"backend = 'vm', but {needs_native} needs compiled code: CasADi's virtual "
                "machine runs smooth scenes only; allowed here: auto, native"
            )

    @property
    def native(self) -> bool:
        """Whether the functions are native code."""
        return self.library is not None

    def operations(self, name: str) -> int:
        """Operations in one call of the function ``name``, with those of functions it calls."""
        return operations(self._functions[name])

    def call(self, name: str) -> Call:
        """Bind the function ``name`` to fresh memory."""
        function = self._functions[name]
        inputs = tuple(_memory(function.size_in(i)) for i in range(function.n_in()))
        outputs = tuple(_memory(function.size_out(i)) for i in range(function.n_out()))
        bind = _virtual if self.library is None else self._bind
        return Call(inputs, outputs, bind(function, inputs, outputs))

    def _compile(self, backend: str, driver: str, needs_native: str) -> None:
        source = '#include "scalar.h"\n' + generate(list(self._functions.values())) + driver
        try:
            code = compiler.build(source)
        except CompilerMissing as error:
            if needs_native or backend == "native":
                who = needs_native or "backend = 'native'"
                raise CompilerMissing(
                    f"{who} needs compiled code, but {error}: {compiler.HOW_TO_GET_CODE}"
                ) from None
            _log.warning("%s: running on CasADi's virtual machine, slower", error)
            return
        self.library, self.backend = code.library, code.origin

    def _bind(
        self, function: ca.Function, inputs: tuple[Array, ...], outputs: tuple[Array, ...]
    ) -> Callable[[], object]:
        entry = getattr(self.library, function.name())
        entry.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int]
        arguments = pointers(inputs, function.sz_arg())
        results = pointers(outputs, function.sz_res())
        integers = np.zeros(max(1, function.sz_iw()), dtype=np.int64)
        reals = np.zeros(max(1, function.sz_w()))
        addresses = (
            ctypes.addressof(arguments),
            ctypes.addressof(results),
            integers.ctypes.data,
            reals.ctypes.data,
            0,
        )
        kept = (inputs, outputs, arguments, results, integers, reals)

        def run(_kept: object = kept) -> None:
            entry(*addresses)

        return run


def generate(functions: Sequence[ca.Function]) -> str:
    """C source of CasADi functions; only they are visible, and long ones come in pieces."""
    generator = ca.CodeGenerator("kernel.c", {"with_header": False, "verbose": False})
    for function in functions:
        generator.add(function)
    visible = '#define CASADI_SYMBOL_EXPORT __attribute__((visibility("default")))\n'
    return visible + divided(str(generator.dump()))


def operations(function: ca.Function) -> int:
    """Arithmetic operations of a function, without loads and stores of arguments and results."""
    if function.is_a("SXFunction"):
        moves = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
        return sum(
            function.instruction_id(k) not in moves for k in range(function.n_instructions())
        )
    total = 0
    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        if kind == ca.OP_CALL:
            total += operations(function.instruction_MX(k).which_function())
        elif kind not in (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_PARAMETER):
            total += int(function.instruction_MX(k).nnz())
    return total


def pointers(arrays: Sequence[NDArray[np.float64]], count: int) -> ctypes.Array[ctypes.c_void_p]:
    """Addresses of arrays in a C array with room for ``count`` pointers."""
    table = (ctypes.c_void_p * max(1, count))()
    for i, array in enumerate(arrays):
        table[i] = array.ctypes.data
    return table


def _memory(shape: tuple[int, int]) -> Array:
    """Zeroed memory as CasADi reads it: a vector, or a matrix in column-major order."""
    rows, columns = shape
    return np.zeros(rows) if columns == 1 else np.zeros((rows, columns), order="F")


def _virtual(
    function: ca.Function, inputs: tuple[Array, ...], outputs: tuple[Array, ...]
) -> Callable[[], object]:
    buffer, evaluate = function.buffer()
    for i, array in enumerate(inputs):
        buffer.set_arg(i, memoryview(array.ravel(order="K")))
    for i, array in enumerate(outputs):
        buffer.set_res(i, memoryview(array.ravel(order="K")))

    def run(_kept: object = (buffer, inputs, outputs)) -> None:
        evaluate()

    return run
