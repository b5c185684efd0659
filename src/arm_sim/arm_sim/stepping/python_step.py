# SPDX-License-Identifier: Apache-2.0
"""The compiled tick as a Python function that takes a command and returns a state."""

from collections.abc import Callable
from typing import Literal

from arm_sim.state import State
from arm_sim.stepping.arm import Arm
from arm_sim.stepping.engine import NATIVE
from arm_sim.stepping.python_function import function_of_structure, unanswered

# Function of a command and the number of ticks before: it advances by a tick and returns the
# state, or False if it cannot be computed; None, and nothing is done, if the command is not an
# array or a list of n finite floats.
PythonStep = Callable[[object, int], State | Literal[False] | None]


def python_step(arm: Arm | None, n: int, nz: int) -> PythonStep:
    """The tick of an arm; ``unanswered`` on the virtual machine."""
    if arm is None:
        return unanswered
    return function_of_structure(NATIVE / "arm/python_step.c", arm, n, nz, arm)
