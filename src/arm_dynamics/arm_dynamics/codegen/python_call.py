# SPDX-License-Identifier: Apache-2.0
"""Generated functions as Python functions that are called without conversions.

They are compiled with the headers of Python and NumPy, so neither ctypes nor a copy is in between.
"""

import ctypes
import sys
import sysconfig
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.codegen import compiler
from arm_dynamics.codegen.kernel import Kernel
from arm_dynamics.exceptions import KernelError

# Function of arrays of one length, finite, contiguous and of float; it returns a new array, and
# None for any other arguments and where the result is not finite.
PythonCall = Callable[..., Array | None]

_SOURCE = compiler.NATIVE / "python_call.c"
_SIZE = ctypes.c_ssize_t
_ARGUMENT_TYPES = ctypes.c_void_p, _SIZE, _SIZE, ctypes.c_int, ctypes.c_void_p, ctypes.py_object


def python_call(kernel: Kernel, name: str, shape: tuple[int, ...]) -> PythonCall:
    """A native function of vectors of one length, with one result; for one thread at a time.

    ``shape`` is that of the result, of one or two dimensions, row by row.
    """
    call = kernel.call(name)
    dimensions = (ctypes.c_ssize_t * len(shape))(*shape)
    entry = ctypes.byref(call.entry) if call.entry else None
    function: PythonCall = python_function(_SOURCE, _ARGUMENT_TYPES)(
        entry, len(call.inputs), call.inputs[0].size, len(shape), dimensions, (call, kernel)
    )
    return function


@cache
def python_function(source: Path, argument_types: tuple[type, ...], *folders: Path) -> Any:
    """The C function ``python_function`` of a file, which makes functions for Python.

    It and they are called with the interpreter lock. The file includes ``python_function.h``;
    ``argument_types`` are types of its arguments, ``folders`` further ones of headers.
    """
    headers = Path(sysconfig.get_path("include"))
    if not (headers / "Python.h").is_file():
        raise KernelError(
            f"calls without conversions need Python's headers, and there is no {headers}/Python.h "
            "(Debian, Ubuntu: apt install python3-dev)"
        )
    versions = f"/* Python {sys.version}, NumPy {np.__version__} */\n".replace("\n", " ") + "\n"
    own = (f"-I{folder}" for folder in folders)
    places = *own, f"-isystem{headers}", f"-isystem{np.get_include()}"
    code = compiler.build(versions + source.read_text(encoding="utf-8"), local=places)
    library = ctypes.PyDLL(code.library._name, handle=code.library._handle)
    library.python_function.argtypes = argument_types
    library.python_function.restype = ctypes.py_object
    return library.python_function
