# SPDX-License-Identifier: Apache-2.0
"""The compiled tick of a simulation as a C function, for other compiled code."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import Structure, addressof, c_double, c_longlong, c_void_p, cast
from functools import partial
from typing import Any


class Roll(Structure):
    """The function ``roll`` of native/roll.c, and its arguments in their order."""

    _fields_ = (
        ("function", c_void_p), ("x", c_void_p), ("command", c_void_p), ("stride", c_longlong),
        ("p", c_void_p), ("dt", c_double), ("ticks", c_longlong), ("trace", c_void_p),
        ("effort", c_void_p), ("notes", c_void_p), ("control", c_void_p), ("report", c_void_p),
    )  # fmt: skip

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
