# SPDX-License-Identifier: Apache-2.0
"""Addresses of arrays for functions of C."""

from __future__ import annotations

import ctypes
from typing import Any

from numpy.typing import NDArray

from arm_dynamics.arrays import Array


def pointer(array: Array) -> ctypes.c_void_p:
    """Address of an array for a C function; it keeps the array alive."""
    place = ctypes.c_void_p(address(array))
    vars(place)["array"] = array
    return place


def address(array: NDArray[Any]) -> int:
    """Address of an array for a C function with ``argtypes``; the caller keeps the array."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    except (TypeError, ValueError):  # read-only, empty, or not contiguous
        place: int = array.__array_interface__["data"][0]
        return place
