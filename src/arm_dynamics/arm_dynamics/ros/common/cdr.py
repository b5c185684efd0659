# SPDX-License-Identifier: Apache-2.0
"""Reading serialized messages piece by piece, where a loop must go on meanwhile.

A generated deserializer makes objects of a whole message in one call: no other thread gets on. The
bytes are CDR version 1 (OMG RTPS 2.5, section 10): a field is
aligned to its size, counted from after the header.
"""

from __future__ import annotations

import struct
import sys
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput

HEADER = 4  # bytes that say how the others are encoded
COUNT = 4  # bytes of a length, and the alignment of a Time
GIGA = 1_000_000_000
NATIVE = b"\x00\x01\x00\x00" if sys.byteorder == "little" else b"\x00\x00\x00\x00"
TIME = struct.Struct("=iI")  # a Time in the byte order of this machine
_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
_LONGEST = 1000  # bytes of a name


def time_bytes(nanoseconds: int) -> bytes:
    """Serialize a Time."""
    return TIME.pack(*divmod(nanoseconds, GIGA))


def as_bytes(message: Any) -> bytes:
    """Serialize a message, unless it is serialized already."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


class CdrReader:
    """Reads one field after another; never past the end, and nothing is made that is not there.

    Attributes:
        at: Offset of what comes next.
    """

    __slots__ = ("_count", "_double", "_raw", "_time", "at")

    def __init__(self, raw: bytes, at: int = HEADER) -> None:
        """Begin at an offset; at first after the header.

        Raises:
            InvalidInput: If there is none, or one of another encoding.
        """
        order = _ORDERS.get(raw[:2])
        if order is None or len(raw) < HEADER:
            raise InvalidInput(
                f"the message begins with '{raw[:HEADER].hex()}'; allowed is CDR version 1: "
                "0000 or 0001"
            )
        self._raw, self.at = raw, at
        self._count, self._time = struct.Struct(f"{order}I"), struct.Struct(f"{order}iI")
        self._double = np.dtype(f"{order}f8")

    def skip(self, size: int, align: int) -> int:
        """Pass over padding and then ``size`` bytes; return where they begin.

        Raises:
            InvalidInput: If the message ends before, as with all that follows.
        """
        start = self.at + -(self.at - HEADER) % align
        if start + size > len(self._raw):
            raise InvalidInput(f"the message ends too early, after {len(self._raw)} bytes")
        self.at = start + size
        return start

    def count(self) -> int:
        """Read a length."""
        return int(self._count.unpack_from(self._raw, self.skip(COUNT, COUNT))[0])

    def count_of(self, what: str, most: int) -> int:
        """Read a length that has a limit.

        Raises:
            InvalidInput: If it is exceeded.
        """
        count = self.count()
        if count > most:
            raise InvalidInput(f"{count} {what}; allowed are up to {most}")
        return count

    def nanoseconds(self) -> int:
        """Read a Time or a Duration in [ns]."""
        seconds, nanoseconds = self._time.unpack_from(self._raw, self.skip(TIME.size, COUNT))
        return int(seconds) * GIGA + int(nanoseconds)

    def text(self) -> str:
        """Read a name, up to its first zero.

        Raises:
            InvalidInput: If it is too long for one.
        """
        size = self.count_of("bytes of a name", _LONGEST)
        start = self.skip(size, 1)
        return self._raw[start : start + size].partition(b"\0")[0].decode(errors="replace")

    def doubles(self) -> Array:
        """View a sequence of numbers in place."""
        return self.array(self.count())

    def array(self, size: int) -> Array:
        """View ``size`` numbers in place."""
        start = self.skip(8 * size, 8 if size else 1)
        return np.frombuffer(self._raw, self._double, size, start)
