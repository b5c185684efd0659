# SPDX-License-Identifier: Apache-2.0
"""Functions of the engine that Python calls directly, each bound to a structure."""

import logging
from collections.abc import Callable
from ctypes import byref, c_ssize_t, c_void_p, py_object
from pathlib import Path
from typing import Any

from arm_dynamics.codegen.python_call import python_function
from arm_dynamics.exceptions import KernelError
from arm_sim.state import State
from arm_sim.stepping.arm import ARM

_TAKES = c_void_p, c_ssize_t, c_ssize_t, py_object, py_object
_log = logging.getLogger(__name__)


def unanswered(*_: object) -> None:
    """None for any arguments: the answer is left to Python."""


def function_of_structure(
    source: Path, structure: Any, n: int, nz: int, owner: object
) -> Callable[..., Any]:
    """A Python function in C, bound to a structure; ``unanswered`` where it cannot be compiled.

    Args:
        source: A file of ``native/``, which defines ``python_function``.
        structure: What that takes a pointer to; C copies it, or keeps the pointer.
        n: Degrees of freedom.
        nz: Number of internal states.
        owner: Kept alive as long as the function is; it owns all memory that C refers to.
    """
    try:
        make = python_function(source, _TAKES, source.parent, ARM.folder)
    except (KernelError, OSError) as error:
        _log.info("calls from Python are slower: %s", error)
        return unanswered
    function: Callable[..., Any] = make(byref(structure), n, nz, State, owner)
    return function
