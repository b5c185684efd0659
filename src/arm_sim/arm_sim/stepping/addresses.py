# SPDX-License-Identifier: Apache-2.0
"""Arrays for functions of C: their addresses and strides, and entries that several share."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
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
        return int(array.__array_interface__["data"][0])


def repeated(array: Array, shape: tuple[int, ...]) -> Array:
    """The array in another shape, repeated by strides of zero."""
    return array if array.shape == shape else np.broadcast_to(array, shape)


def strides(array: Array, axes: int) -> list[int]:
    """Numbers from one entry to the next along the first axes."""
    return [stride // 8 for stride in array.strides[:axes]]
