# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a tick as a Python function that takes a state and a command."""

import ctypes
from collections.abc import Callable

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address
from arm_dynamics.codegen.header import Header
from arm_sim.derivatives.tangents.functions import TANGENTS
from arm_sim.derivatives.tangents.tangents import Tangents
from arm_sim.plant.plant import Plant
from arm_sim.stepping.engine import NATIVE, address_of
from arm_sim.stepping.python_function import function_of_structure, unanswered

# Function of a state and a command: derivatives by both side by side, or None where they are left
# to Python, and where the command is not an array or a list of n finite floats.
Linearize = Callable[[object, object], Array | None]

_FOLDER = NATIVE / "derivatives"
_Arguments = Header(_FOLDER / "linearize.h").structure("linearize_t")


def python_linearize(tangents: Tangents, plant: Plant, p: Array, dt: float) -> Linearize:
    """The function of an arm; ``unanswered`` where it cannot be compiled.

    Args:
        tangents: Derivatives by state and command.
        plant: The equations.
        p: Tunable quantities, to be changed in place, shape (np,).
        dt: Length of a tick in [s].
    """
    if (code := tangents.library(1)) is None:
        return unanswered
    engine, entry = tangents.engine, ctypes.cast(code.engine.differentiate_tick, ctypes.c_void_p)
    arguments = _Arguments(
        entry.value, code.scene.value, address_of(code.own, TANGENTS),
        engine and ctypes.addressof(engine), address(p), dt,
    )  # fmt: skip
    source, owner = _FOLDER / "python_linearize.c", (code, engine, p)
    return function_of_structure(source, arguments, plant.model.n, plant.nz, owner)
