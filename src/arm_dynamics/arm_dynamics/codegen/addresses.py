# SPDX-License-Identifier: Apache-2.0
"""Addresses of buffers for functions of C."""

from __future__ import annotations

import ctypes
from typing import Any

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
        data: int = buffer.__array_interface__["data"][0]
        return data


def pointer(array: Array) -> ctypes.c_void_p:
    """Pointer to an array for a C function; it keeps the array alive."""
    result = ctypes.c_void_p(address(array))
    vars(result)["array"] = array
    return result
