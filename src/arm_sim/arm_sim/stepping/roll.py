# SPDX-License-Identifier: Apache-2.0
"""The compiled tick of a simulation as a C function, for other compiled code."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, addressof, c_void_p, cast
from functools import partial
from pathlib import Path
from typing import Any

from arm_dynamics.codegen.header import Header

STEP = Header(Path(__file__).with_name("native") / "motion/step.h")


class Roll(Structure):
    """``step_t`` of step.h: the function ``roll``, and its arguments in their order."""

    _fields_ = STEP.fields("step_t")

    @classmethod
    def of(cls, tick: Callable[[], int]) -> Roll | None:
        """The function that ``Stepper.bound`` returned; None on the virtual machine.

        It does not keep the arrays alive that the arguments point at.
        """
        arguments = vars(tick).get("arguments")
        if arguments is None or not isinstance(tick, partial):
            return None
        entry: Any = tick.func
        return cls(cast(entry, c_void_p).value, *map(_value, arguments))


def _value(argument: Any) -> Any:
    if hasattr(argument, "_obj"):  # by reference
        return addressof(argument._obj)
    return None if argument is None else argument.value
