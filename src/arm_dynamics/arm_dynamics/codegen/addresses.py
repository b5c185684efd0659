# SPDX-License-Identifier: Apache-2.0
"""Arrays for functions of C: their addresses and strides, and entries that several share."""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array


def address(buffer: NDArray[Any] | bytearray) -> int:
    """Address of a buffer for a C function with ``argtypes``; the caller keeps the buffer.

    The size of a ``bytearray`` is fixed from now on.
    """
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(buffer))
    except (TypeError, ValueError):  # an array that is read-only, empty, or not contiguous
        if isinstance(buffer, bytearray):
            raise
        return int(buffer.__array_interface__["data"][0])


def pointer(array: Array) -> ctypes.c_void_p:
    """Pointer to an array for a C function; it keeps the array alive."""
    result = ctypes.c_void_p(address(array))
    vars(result)["array"] = array
    return result


def repeated(array: Array, shape: tuple[int, ...]) -> Array:
    """The array in another shape, repeated by strides of zero."""
    return array if array.shape == shape else np.broadcast_to(array, shape)


def strides(array: Array, axes: int) -> list[int]:
    """Numbers from one entry to the next along the first axes."""
    return [stride // 8 for stride in array.strides[:axes]]
