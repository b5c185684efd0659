# SPDX-License-Identifier: Apache-2.0
"""Executable functions from expressions.

They run as native code, or on CasADi's virtual machine if there is no compiler.
"""

import ctypes
import logging
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Self

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.attributes import frozen
from arm_dynamics.codegen import compiler, known_kernels
from arm_dynamics.codegen.compiled_scenes import Code
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.known_kernels import Note, Signature
from arm_dynamics.codegen.split_functions import divided
from arm_dynamics.exceptions import CompilerMissing, InvalidInput, KernelError, choices

ENTRY = Header(compiler.NATIVE / "entry.h")
BACKENDS = ("auto", "native", "vm")
_log = logging.getLogger(__name__)


class Entry(ctypes.Structure):
    """``entry_t`` of entry.h: a compiled function and its memory, for other compiled code."""

    _fields_ = ENTRY.fields("entry_t")


@frozen
class Call:
    """A function bound to memory of its own: write ``inputs``, call ``run``, read ``outputs``.

    Two threads must not use one instance at once.

    Attributes:
        inputs: One array per argument, to be written in place.
        outputs: One array per result, overwritten by each call.
        run: The function itself.
        entry: The function for other compiled code, valid while this object exists; None on the
            virtual machine.
    """

    inputs: tuple[Array, ...]
    outputs: tuple[Array, ...]
    run: Callable[[], object]
    entry: Entry | None = None

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
            ``auto``: native if possible.
        driver: C source that may call the functions, compiled with them.
        local: Flags of the compiler, see ``compiler.build``.
        needs_native: Features of the scene that need native code, such as "dry friction"; empty if
            there are none.

    Raises:
        InvalidInput: If the backend is unknown.
        KernelError: If native code is requested or needed, and not available; says how to get it.
    """

    def __init__(
        self,
        functions: Sequence[ca.Function],
        backend: str = "auto",
        driver: str = "",
        needs_native: str = "",
        local: tuple[str, ...] = (),
    ) -> None:
        if backend not in BACKENDS:
            raise InvalidInput(f"backend = {backend!r}; allowed: {choices(backend, BACKENDS)}")
        code = None
        if backend != "vm":
            needs = needs_native or ("backend = 'native'" if backend == "native" else "")
            code = _compile(generate(functions) + driver, local, needs)
        elif needs_native:
            raise KernelError(
                f"backend = 'vm', but {needs_native} needs compiled code: CasADi's virtual "
                "machine runs smooth scenes only; allowed here: auto, native"
            )
        self._code = code  # none on the virtual machine
        self._functions = {function.name(): function for function in functions}
        self._signatures = {name: _signature(f) for name, f in self._functions.items()}
        self._operations: dict[str, int] = {}

    @classmethod
    def recall(cls, recipe: str) -> Self | None:
        """The kernel that was kept under a recipe, without its expressions; None if there is none.

        Args:
            recipe: Text of all inputs from which the functions and the driver are generated.
        """
        if (entry := known_kernels.recall(recipe)) is None:
            return None
        kernel = cls([], "vm")
        kernel._code, note = entry
        kernel._signatures = {signature.name: signature for signature in note.functions}
        kernel._operations = note.operations
        return kernel

    def keep(self, recipe: str) -> None:
        """Keep native code under a recipe, see ``recall``."""
        if (code := self._code) is not None:
            counts = {name: self.operations(name) for name in self._signatures}
            functions = tuple(self._signatures.values())
            known_kernels.keep(recipe, Note(key=code.key, functions=functions, operations=counts))

    @property
    def library(self) -> ctypes.CDLL | None:
        """The compiled code."""
        return self._code.library if self._code else None

    @property
    def backend(self) -> str:
        """Compiler and place of compilation, or the virtual machine."""
        return self._code.origin if self._code else "virtual machine of CasADi"

    @property
    def native(self) -> bool:
        """Whether the functions are native code."""
        return self.library is not None

    def operations(self, name: str) -> int:
        """Operations in one call of the function ``name``, with those of functions it calls."""
        if name not in self._operations:
            self._operations[name] = operations(self._functions[name])
        return self._operations[name]

    def call(self, name: str) -> Call:
        """Bind the function ``name`` to fresh memory."""
        signature = self._signatures[name]
        inputs = tuple(_memory(shape) for shape in signature.inputs)
        outputs = tuple(_memory(shape) for shape in signature.outputs)
        if self.library is None:
            return Call(inputs, outputs, _virtual(self._functions[name], inputs, outputs))
        return Call(inputs, outputs, *self._bind(signature, inputs, outputs))

    def _bind(
        self, signature: Signature, inputs: tuple[Array, ...], outputs: tuple[Array, ...]
    ) -> tuple[Callable[[], object], Entry]:
        """The compiled function with its memory, for Python and for other compiled code."""
        function = getattr(self.library, signature.name)
        function.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int]
        of_arguments, of_results, of_integers, of_reals = signature.sizes
        arguments, results = pointers(inputs, of_arguments), pointers(outputs, of_results)
        integers = np.zeros(max(1, of_integers), dtype=np.int64)
        reals = np.zeros(max(1, of_reals))
        tables = (ctypes.addressof(table) for table in (arguments, results))
        addresses = (*tables, integers.ctypes.data, reals.ctypes.data, 0)
        buffers = (inputs, outputs, arguments, results, integers, reals)

        def run(_buffers: object = buffers) -> None:
            function(*addresses)

        return run, Entry(ctypes.cast(function, ctypes.c_void_p), *addresses[:4])


def _compile(source: str, local: tuple[str, ...], needs: str) -> Code | None:
    """Native code; None if there is no compiler, unless something needs it."""
    try:
        return compiler.build(f'#include "scalar.h"\n{source}', local=local)
    except CompilerMissing as error:
        if needs:
            why = f"{needs} needs compiled code, but {error}: {compiler.HOW_TO_GET_CODE}"
            raise CompilerMissing(why) from None
        _log.warning("%s: running on CasADi's virtual machine, slower", error)
        return None


def _signature(function: ca.Function) -> Signature:
    """Signature of a CasADi function."""
    return Signature(
        name=function.name(),
        inputs=tuple(function.size_in(i) for i in range(function.n_in())),
        outputs=tuple(function.size_out(i) for i in range(function.n_out())),
        sizes=(function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w()),
    )


def generate(functions: Sequence[ca.Function]) -> str:
    """C source of CasADi functions; only they are exported, and long ones are divided."""
    generator = ca.CodeGenerator("kernel.c", {"with_header": False, "verbose": False})
    for function in functions:
        outputs = map(function.sparsity_out, range(function.n_out()))
        assert all(pattern.is_dense() for pattern in outputs), f"{function}: its callers read all"
        generator.add(function)
    visible = '#define CASADI_SYMBOL_EXPORT __attribute__((visibility("default")))\n'
    return visible + divided(str(generator.dump()))


def operations(function: ca.Function, weights: Mapping[int, int] | None = None) -> int:
    """Arithmetic operations of a function, without loads and stores of arguments and results.

    ``weights`` gives kinds of operations that count more than once.
    """
    weights = weights or {}
    if function.is_a("SXFunction"):
        kinds = Counter(map(function.instruction_id, range(function.n_instructions())))
        moves = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
        return sum(kinds[kind] * weights.get(kind, 1) for kind in kinds if kind not in moves)
    total = 0
    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        if kind == ca.OP_CALL:
            total += operations(function.instruction_MX(k).which_function(), weights)
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
    """Zeroed memory in CasADi's layout: a vector, or a matrix in column-major order."""
    rows, columns = shape
    return np.zeros(rows) if columns == 1 else np.zeros((rows, columns), order="F")


def _virtual(
    function: ca.Function, inputs: tuple[Array, ...], outputs: tuple[Array, ...]
) -> Callable[[], object]:
    """A function with its memory on CasADi's virtual machine."""
    buffer, evaluate = function.buffer()
    for i, array in enumerate(inputs):
        buffer.set_arg(i, memoryview(array.ravel(order="K")))
    for i, array in enumerate(outputs):
        buffer.set_res(i, memoryview(array.ravel(order="K")))

    def run(_buffers: object = (buffer, inputs, outputs)) -> None:
        evaluate()

    return run
