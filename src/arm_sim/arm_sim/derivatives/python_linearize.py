# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a tick as a Python function that takes a state and a command."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from typing import Any

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.python_call import python_function
from arm_dynamics.exceptions import KernelError
from arm_sim.derivatives.tangents import TANGENTS, Tangents
from arm_sim.plant.plant import Plant
from arm_sim.state import State
from arm_sim.stepping.arm import ARM
from arm_sim.stepping.engine import NATIVE, address_of
from arm_sim.stepping.rollout import Engine
from arm_sim.stepping.stepper import address

Linearize = Callable[[object, object], Array | None]
"""Function of a state and a command: derivatives by both side by side, or None where this function does not
find them, and where the command is not an array or a list of n finite floats."""

_FOLDER = NATIVE / "derivatives"
_TAKES = ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_ssize_t, ctypes.py_object, ctypes.py_object
_log = logging.getLogger(__name__)


class _Arguments(ctypes.Structure):
    """``linearize_t`` of linearize.h."""

    _fields_ = Header(_FOLDER / "linearize.h").fields("linearize_t")


def unanswered(*_: object) -> None:
    """No derivatives: they are left to Python."""


def python_linearize(
    tangents: Tangents, engine: Engine | None, plant: Plant, p: Array, dt: float
) -> Linearize:
    """The function of an arm; ``unanswered`` where it cannot be compiled.

    Args:
        tangents: Derivatives by state and command.
        engine: In a scene with events, what finds the modes of a tick.
        plant: The equations.
        p: Tunable quantities, to be changed in place, shape (np,).
        dt: Length of a tick in [s].
    """
    code = tangents.library(1)
    if code is None:
        return unanswered
    try:
        make = python_function(_FOLDER / "python_linearize.c", _TAKES, _FOLDER, ARM.folder)
    except (KernelError, OSError) as error:
        _log.info("derivatives from Python are slower: %s", error)
        return unanswered
    entry: Any = code.engine.differentiate_tick
    arguments = _Arguments(
        ctypes.cast(entry, ctypes.c_void_p).value, code.scene.value,
        address_of(code.own, TANGENTS), engine and ctypes.addressof(engine), address(p), dt,
    )  # fmt: skip
    kept = code, engine, p
    made: Linearize = make(ctypes.byref(arguments), plant.model.n, plant.nz, State, kept)
    return made
