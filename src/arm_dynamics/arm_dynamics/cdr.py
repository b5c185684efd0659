# SPDX-License-Identifier: Apache-2.0
"""Reading and writing of serialized messages field by field.

A generated deserializer creates objects for a whole message in one call, which blocks all other
threads; and message files must be readable and writable without ROS. The bytes are CDR version 1
(OMG RTPS 2.5, section 10): a field is aligned to its size, relative to the end of the header.
"""

import struct
import sys
from collections.abc import Sequence

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import InvalidInput

HEADER = 4  # length of the header, which declares the encoding
COUNT = 4  # size of a length, and alignment of a Time
GIGA = 1_000_000_000
NATIVE = b"\x00\x01\x00\x00" if sys.byteorder == "little" else b"\x00\x00\x00\x00"
TIME = struct.Struct("=iI")  # a Time in native byte order
_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
_NAME_LIMIT = 1000  # [B], longest name


def time_bytes(nanoseconds: int) -> bytes:
    """Serialize a Time."""
    return TIME.pack(*divmod(nanoseconds, GIGA))


class CdrReader:
    """Reads one field after another, never past the end of the message.

    Attributes:
        at: Offset of the next field.
    """

    __slots__ = ("_count", "_double", "_raw", "_time", "at")

    def __init__(self, raw: bytes, at: int = HEADER) -> None:
        """Start at an offset, by default after the header.

        Raises:
            InvalidInput: If there is no header, or one of another encoding.
        """
        order = _ORDERS.get(raw[:2])
        if order is None or len(raw) < HEADER:
            raise InvalidInput(
                f"the message begins with '{raw[:HEADER].hex()}'; allowed: CDR version 1: "
                "0000 or 0001"
            )
        self._raw, self.at = raw, at
        self._count, self._time = struct.Struct(f"{order}I"), struct.Struct(f"{order}iI")
        self._double = np.dtype(f"{order}f8")

    def skip(self, size: int, align: int) -> int:
        """Skip padding and ``size`` bytes; return the offset of the latter.

        Raises:
            InvalidInput: If the message ends before, as with all methods below.
        """
        start = self.at + -(self.at - HEADER) % align
        if start + size > len(self._raw):
            raise InvalidInput(f"the message ends too early, after {len(self._raw)} bytes")
        self.at = start + size
        return start

    def count(self) -> int:
        """Read a length."""
        return int(self._count.unpack_from(self._raw, self.skip(COUNT, COUNT))[0])

    def count_of(self, noun: str, limit: int) -> int:
        """Read a length that must not exceed ``limit``."""
        count = self.count()
        if count > limit:
            raise InvalidInput(f"{count} {noun}; allowed: up to {limit}")
        return count

    def byte(self) -> int:
        """Read a byte."""
        return self._raw[self.skip(1, 1)]

    def nanoseconds(self) -> int:
        """Read a Time or a Duration in [ns]."""
        seconds, nanoseconds = self._time.unpack_from(self._raw, self.skip(TIME.size, COUNT))
        return int(seconds) * GIGA + int(nanoseconds)

    def text(self) -> str:
        """Read a name of limited length, up to its first zero."""
        size = self.count_of("bytes of a name", _NAME_LIMIT)
        start = self.skip(size, 1)
        return self._raw[start : start + size].partition(b"\0")[0].decode(errors="replace")

    def doubles(self) -> Array:
        """View a sequence of numbers in place."""
        return self.array(self.count())

    def array(self, size: int) -> Array:
        """View ``size`` numbers in place."""
        start = self.skip(8 * size, 8 if size else 1)
        return np.frombuffer(self._raw, self._double, size, start)

    def texts(self, limit: int = 10_000) -> list[str]:
        """Read a sequence of names."""
        return [self.text() for _ in range(self.count_of("names", limit))]


class CdrWriter:
    """Writes one field after another, in native byte order.

    Attributes:
        raw: The message so far.
    """

    def __init__(self) -> None:
        self.raw = bytearray(NATIVE)

    def put(self, piece: bytes, align: int) -> int:
        """Append padding and bytes; return the offset of the latter."""
        self.raw += bytes(-(len(self.raw) - HEADER) % align) + piece
        return len(self.raw) - len(piece)

    def count(self, count: int) -> int:
        """Append a length, or another whole number of 32 bits."""
        return self.put(count.to_bytes(COUNT, sys.byteorder), COUNT)

    def time(self, nanoseconds: int) -> int:
        """Append a Time."""
        return self.put(time_bytes(nanoseconds), COUNT)

    def text(self, text: str) -> int:
        """Append a text."""
        encoded = text.encode() + b"\0"
        self.count(len(encoded))
        return self.put(encoded, 1)

    def texts(self, texts: Sequence[str]) -> None:
        """Append a sequence of texts."""
        self.count(len(texts))
        for text in texts:
            self.text(text)

    def doubles(self, numbers: Array) -> int:
        """Append a sequence of numbers; return the offset of the first one."""
        self.count(numbers.size)
        return self.array(numbers)

    def array(self, numbers: Array) -> int:
        """Append numbers without their count."""
        return self.put(numbers.astype(float).tobytes(), 8 if numbers.size else 1)
