# SPDX-License-Identifier: Apache-2.0
"""A message in C memory, and its conversion from and to Python."""

from __future__ import annotations

import ctypes
from ctypes import c_char_p, c_void_p, py_object
from typing import Any

from rclpy.type_support import check_for_type_support


class CMessage:
    """Memory of a message, for ROS's C functions.

    Attributes:
        address: Valid until ``close``.
    """

    def __init__(self, kind: Any) -> None:
        """Allocate the memory; ``kind`` is the class of a message, request or response."""
        check_for_type_support(kind)
        support = type(kind)  # the functions that rclpy uses for it
        self._destroy = ctypes.CFUNCTYPE(None, c_void_p)(_address(support._DESTROY_ROS_MESSAGE))
        self._write = ctypes.PYFUNCTYPE(ctypes.c_bool, py_object, c_void_p)(
            _address(support._CONVERT_FROM_PY)
        )
        self._read = ctypes.PYFUNCTYPE(py_object, c_void_p)(_address(support._CONVERT_TO_PY))
        create = ctypes.CFUNCTYPE(c_void_p)(_address(support._CREATE_ROS_MESSAGE))
        self.address = c_void_p(create())

    @classmethod
    def of(cls, message: Any) -> CMessage:
        """A message with the content of a Python message."""
        copy = cls(type(message))
        copy._write(message, copy.address)
        return copy

    def read(self) -> Any:
        """Its current content as a Python message."""
        return self._read(self.address)

    def close(self) -> None:
        """Free the memory."""
        self._destroy(self.address)


def _address(capsule: Any) -> int:
    """The address that a capsule holds."""
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.argtypes, pointer.restype = [py_object, c_char_p], c_void_p
    return int(pointer(capsule, None))
