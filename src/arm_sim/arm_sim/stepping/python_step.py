# SPDX-License-Identifier: Apache-2.0
"""The compiled tick as a Python function that takes a command and returns a state."""

from __future__ import annotations

import logging
from collections.abc import Callable
from ctypes import byref, c_ssize_t, c_void_p, py_object
from pathlib import Path
from typing import Literal

from arm_dynamics.codegen.python_call import python_function
from arm_dynamics.exceptions import KernelError
from arm_sim.state import State
from arm_sim.stepping.arm import ARM, Arm

PythonStep = Callable[[object, int], State | Literal[False] | None]
"""Function of a command and the number of ticks before: it advances by a tick and returns the
state, or False if it cannot be computed; None, and nothing is done, if the command is not an array
or a list of n finite floats."""

_SOURCE = Path(__file__).with_name("native") / "arm/python_step.c"
_TAKES = c_void_p, c_ssize_t, c_ssize_t, py_object, py_object
_log = logging.getLogger(__name__)


def unanswered(*_: object) -> None:
    """No tick: it is left to Python."""


def python_step(arm: Arm | None, n: int, nz: int) -> PythonStep:
    """The function of an arm; ``unanswered`` where it cannot be compiled.

    Args:
        arm: The arm; None on the virtual machine.
        n: Degrees of freedom.
        nz: Number of internal states.
    """
    if arm is None:
        return unanswered
    try:
        make = python_function(_SOURCE, _TAKES, ARM.folder)
    except (KernelError, OSError) as error:
        _log.info("steps from Python are slower: %s", error)
        return unanswered
    made: PythonStep = make(byref(arm), n, nz, State, arm)
    return made
