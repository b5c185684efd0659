# SPDX-License-Identifier: Apache-2.0
"""Where things stand in a serialized JointState (CDR version 1)."""

from __future__ import annotations

import struct
import sys
from typing import Any, NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from arm_dynamics.arrays import Array
from arm_dynamics.ros.common.cdr import HEADER, TIME, aligned

FIELDS = ("position", "velocity", "effort")
NATIVE = b"\x00\x01\x00\x00" if sys.byteorder == "little" else b"\x00\x00\x00\x00"
_FIRST = 3  # place in a record after the header and the stamp


class Layout(NamedTuple):
    """Where things stand in a serialized JointState.

    Attributes:
        size: Bytes up to the last number.
        arrays: Offset and length of position, velocity and effort.
        record: Takes a message apart: a piece of bytes, the two numbers of the stamp, then a piece
            before the numbers of each array that has any, and the rest if there is one.
        pieces: Place in the record and bytes of all that is neither stamp nor numbers, padding
            included.
        numbers: Places in the record of position, velocity and effort.
        fixed: 1 for every bit that is the same in all messages of this layout, as one integer.
        expected: What these bits are.
    """

    size: int
    arrays: tuple[tuple[int, int], ...]
    record: struct.Struct
    pieces: tuple[tuple[int, bytes], ...]
    numbers: tuple[slice, ...]
    fixed: int
    expected: int

    def read(self, raw: bytes) -> tuple[Any, ...] | None:
        """Take ``raw`` apart by the record; None if it has another layout."""
        if len(raw) < self.size:
            return None
        found = self.record.unpack_from(raw)
        for place, piece in self.pieces:
            if found[place] != piece:  # perhaps only other rubbish in the padding
                as_one = int.from_bytes(raw[: self.size], "little")
                return found if as_one & self.fixed == self.expected else None
        return found

    def masks(self) -> tuple[bytes, bytes]:
        """``fixed`` and ``expected`` byte by byte."""
        size = self.size
        return self.fixed.to_bytes(size, "little"), self.expected.to_bytes(size, "little")

    def array(self, raw: bytes | bytearray, field: int) -> Array:
        """View the numbers of one field in place."""
        offset, length = self.arrays[field]
        return np.frombuffer(raw, np.float64, length, offset)


class _Walk:
    """Walks over a serialized message and notes which bytes are the same in every one like it."""

    def __init__(self) -> None:
        self.at = 0
        self.mask = bytearray()

    def skip(self, size: int, align: int) -> int:
        """Pass over padding and then ``size`` bytes that change; return where they begin."""
        start = aligned(self.at, align)
        self.at = start + size
        self.mask.extend(bytes(self.at - len(self.mask)))
        return start

    def fixed(self, size: int, align: int) -> None:
        """Pass over padding, which may hold anything, and then ``size`` bytes that stay."""
        start = self.skip(size, align)
        self.mask[start:] = b"\xff" * size

    def text(self, text: str) -> None:
        """Pass over a string: its length, its characters and a zero."""
        self.fixed(4, 4)
        self.fixed(len(text.encode()) + 1, 1)


def layout_of(message: JointState, raw: bytes) -> Layout:
    """Find out where things stand in ``raw``, the serialized ``message``."""
    walk = _Walk()
    walk.fixed(HEADER, 1)
    walk.skip(TIME.size, 4)
    walk.text(message.header.frame_id)
    walk.fixed(4, 4)
    for name in message.name:
        walk.text(name)
    arrays = []
    for field in FIELDS:
        length = len(getattr(message, field))
        walk.fixed(4, 4)
        arrays.append((walk.skip(8 * length, 8 if length else 1), length))
    fixed = int.from_bytes(walk.mask, "little")
    expected = int.from_bytes(raw[: walk.at], "little") & fixed
    form, at, place = f"={HEADER}siI", HEADER + TIME.size, _FIRST
    pieces, numbers = [(0, bytes(raw[:HEADER]))], []
    for start, length in arrays:
        if not length and message.name:  # that it is empty is part of the next piece
            numbers.append(slice(0, 0))
            continue
        form += f"{start - at}s{length}d"
        pieces.append((place, bytes(raw[at:start])))
        numbers.append(slice(place + 1, place + 1 + length))
        at, place = start + 8 * length, place + 1 + length
    if at < walk.at:
        form += f"{walk.at - at}s"
        pieces.append((place, bytes(raw[at : walk.at])))
    record = struct.Struct(form)
    return Layout(walk.at, tuple(arrays), record, tuple(pieces), tuple(numbers), fixed, expected)
