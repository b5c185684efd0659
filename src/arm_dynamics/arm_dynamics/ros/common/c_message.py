# SPDX-License-Identifier: Apache-2.0
"""A message as C keeps it, and its way from Python and back."""

from __future__ import annotations

import ctypes
from ctypes import c_char_p, c_void_p, py_object
from typing import Any

from rclpy.type_support import check_for_type_support


class CMessage:
    """Memory for a message of a type, as ROS's functions in C take it.

    Attributes:
        place: Its address, valid until ``close``.
    """

    def __init__(self, kind: Any) -> None:
        """Get the memory; ``kind`` is the message's class, or a request's or response's."""
        check_for_type_support(kind)
        support = type(kind)  # the functions with which rclpy itself does it
        self._destroy = ctypes.CFUNCTYPE(None, c_void_p)(_in(support._DESTROY_ROS_MESSAGE))
        self._write = ctypes.PYFUNCTYPE(ctypes.c_bool, py_object, c_void_p)(
            _in(support._CONVERT_FROM_PY)
        )
        self._read = ctypes.PYFUNCTYPE(py_object, c_void_p)(_in(support._CONVERT_TO_PY))
        self.place = c_void_p(ctypes.CFUNCTYPE(c_void_p)(_in(support._CREATE_ROS_MESSAGE))())

    @classmethod
    def of(cls, message: Any) -> CMessage:
        """A message that says what one of Python says."""
        made = cls(type(message))
        made._write(message, made.place)
        return made

    def read(self) -> Any:
        """What it says now, as a message of Python."""
        return self._read(self.place)

    def close(self) -> None:
        """Give the memory back."""
        self._destroy(self.place)


def _in(capsule: Any) -> int:
    """The address in a capsule."""
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.argtypes, pointer.restype = [py_object, c_char_p], c_void_p
    return int(pointer(capsule, None))
