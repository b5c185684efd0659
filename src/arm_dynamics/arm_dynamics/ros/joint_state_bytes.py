# SPDX-License-Identifier: Apache-2.0
"""JointState as bytes: written by patching a serialized message, read by looking at known places.

A generated serializer takes 50 to 120 µs in Python; with names and lengths fixed, all that changes
from message to message is the stamp and the numbers. The bytes are CDR version 1 (OMG RTPS 2.5,
section 10): a header of 4 bytes, then fields aligned to their size, counted from after the header.
"""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.exceptions import InvalidInput, known_names

Array = NDArray[np.float64]

Indices = NDArray[np.intp]

FIELDS = ("position", "velocity", "effort")
_NATIVE = b"\x00\x01\x00\x00" if sys.byteorder == "little" else b"\x00\x00\x00\x00"
_STAMP = struct.Struct("=iI")
_STAMP_AT = 4
_FIRST = 3  # place in a record after the header and the stamp
_GIGA = 1_000_000_000
_KINDS = 4  # layouts kept at once, for several publishers on one topic


class Layout(NamedTuple):
    """Where things stand in a serialized JointState.

    Attributes:
        size: Bytes up to the last number.
        arrays: Offset and length of position, velocity and effort.
        record: Takes a message apart: pieces of bytes, after the first one the two numbers of the
            stamp, and the numbers of each array before the next piece.
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
        start = self.at + -(self.at - len(_NATIVE)) % align
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
    walk.fixed(len(_NATIVE), 1)
    walk.skip(_STAMP.size, 4)
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
    form, at, place = f"={_STAMP_AT}siI", _STAMP_AT + _STAMP.size, _FIRST
    pieces, numbers = [(0, bytes(raw[:_STAMP_AT]))], []
    for start, length in arrays:
        form += f"{start - at}s{length}d"
        pieces.append((place, bytes(raw[at:start])))
        numbers.append(slice(place + 1, place + 1 + length))
        at, place = start + 8 * length, place + 1 + length
    record = struct.Struct(form)
    return Layout(walk.at, tuple(arrays), record, tuple(pieces), tuple(numbers), fixed, expected)


def all_finite(array: Array) -> bool:
    """Tell whether all numbers are finite, for a few numbers in a third of NumPy's time."""
    return all(map(math.isfinite, array.tolist()))


class JointStateWriter:
    """A serialized JointState whose stamp and numbers are patched in place.

    Example:
        >>> writer = JointStateWriter(names, ("effort",))
        >>> publisher.publish(writer.write(stamp, tau))
    """

    def __init__(
        self, names: Sequence[str], fields: Sequence[str] = FIELDS, frame_id: str = ""
    ) -> None:
        """Serialize a template once; only ``fields`` are sent, the others stay empty."""
        message = JointState(name=list(names))
        message.header.frame_id = frame_id
        for field in fields:
            setattr(message, field, [0.0] * len(names))
        raw = serialize_message(message)
        layout = layout_of(message, raw)
        self._buffer = bytearray(layout.expected.to_bytes(layout.size, "little"))
        self._arrays = [layout.array(self._buffer, FIELDS.index(field)) for field in fields]

    def write(self, stamp: int, *arrays: Array) -> bytes:
        """Return the message.

        Args:
            stamp: Time in [ns].
            arrays: One array for each of the writer's fields, shape (n,).
        """
        _STAMP.pack_into(self._buffer, _STAMP_AT, *divmod(stamp, _GIGA))
        for place, array in zip(self._arrays, arrays, strict=True):
            place[:] = array
        return bytes(self._buffer)


class _Known(NamedTuple):
    """A layout that was met, and which of its numbers go where; None: all of them as they are.

    Attributes:
        source: The header's frame_id.
        joints: Indices of the joints that it names.
    """

    layout: Layout
    places: tuple[Indices, Indices] | None
    source: str
    joints: frozenset[int]


class JointStateReader:
    """Reads serialized JointStates into arrays in a given order of joints.

    The first message of a kind is read by the generated deserializer and checked; the following
    ones with the same names and lengths are read by looking at the same places.

    Attributes:
        slow_reads: How many messages took the generated deserializer.
    """

    def __init__(
        self,
        names: Sequence[str],
        fields: Sequence[str],
        *,
        partial: bool,
        extra: bool,
        admit: Callable[[str, frozenset[int]], None] = lambda source, joints: None,
    ) -> None:
        """Choose what to read.

        Args:
            names: Joints, in the order of the arrays read.
            fields: Those of position, velocity and effort that must be there.
            partial: Whether joints may be absent; those keep what was read before, at first zero.
            extra: Whether joints that are not in ``names`` are passed over.
            admit: Called with the frame_id of each message and the indices of the joints that it
                names, before its numbers count; may raise InvalidInput.
        """
        self._names, self._fields = list(names), [FIELDS.index(field) for field in fields]
        self._partial, self._extra, self._admit = partial, extra, admit
        self._values = [np.zeros(len(self._names)) for _ in fields]
        self._known: list[_Known] = []
        self.slow_reads = 0

    def read(self, raw: bytes) -> tuple[int, list[Array]]:
        """Read a message.

        Args:
            raw: The serialized JointState.

        Returns:
            Its stamp in [ns] and a new array of shape (n,) for each of the fields.

        Raises:
            InvalidInput: If joints or numbers are missing, unknown, doubled or not finite.
        """
        for known in self._known:
            if (found := known.layout.read(raw)) is not None:
                break
        else:
            known, found = self._learn(raw)
        self._admit(known.source, known.joints)
        values = []
        for before, field in zip(self._values, self._fields, strict=True):
            numbers = found[known.layout.numbers[field]]
            array = np.array(numbers, np.float64)
            if known.places is not None:
                source, to = known.places
                array, given = before.copy(), array
                array[to] = given[source]
                numbers = array.tolist()
            if not all(map(math.isfinite, numbers)):
                self._refuse_infinite(field, array)
            values.append(array)
        self._values = values
        return found[1] * _GIGA + found[2], values

    def _refuse_infinite(self, field: int, array: Array) -> NoReturn:
        joint = int(np.argmin(np.isfinite(array)))
        raise InvalidInput(
            f"{FIELDS[field]} of joint '{self._names[joint]}' is {array[joint]}; "
            "allowed are finite numbers"
        )

    def _learn(self, raw: bytes) -> tuple[_Known, tuple[Any, ...]]:
        """Take the long way, check the message and remember where things stand in it."""
        self.slow_reads += 1
        try:
            message = deserialize_message(raw, JointState)
            if not raw.startswith(_NATIVE):  # from a machine of the other endianness
                raw = serialize_message(message)
        except Exception as error:
            raise InvalidInput(f"{len(raw)} bytes are not a JointState: {error}") from error
        places = self._places(message)
        joints = range(len(self._names)) if places is None else places[1].tolist()
        source = message.header.frame_id
        known = _Known(layout_of(message, raw), places, source, frozenset(joints))
        for field, name in enumerate(FIELDS):
            if known.layout.array(raw, field).tobytes() != getattr(message, name).tobytes():
                raise InvalidInput(f"{name} of the message is not where CDR puts it")
        self._known = [known, *self._known[: _KINDS - 1]]
        return known, known.layout.record.unpack_from(raw)

    def _places(self, message: JointState) -> tuple[Indices, Indices] | None:
        """Check names and lengths; say which numbers of the message go where."""
        names = list(message.name)
        if len(set(names)) != len(names):
            raise InvalidInput(f"joints {names} are not all different; allowed is each once")
        for field in self._fields:
            length = len(getattr(message, FIELDS[field]))
            if length != len(names):
                raise InvalidInput(
                    f"{FIELDS[field]} has {length} numbers for {len(names)} joints; "
                    "allowed is one for each name"
                )
        here = [name for name in names if name in self._names]
        missing = [name for name in self._names if name not in names]
        if len(here) < len(names) and not self._extra:
            unknown = known_names(name for name in names if name not in self._names)
            allowed = known_names(self._names)
            raise InvalidInput(f"unknown joints {unknown}; allowed are {allowed}")
        if missing and (not here or not self._partial):
            raise InvalidInput(f"joints {known_names(missing)} are missing")
        if names == self._names:
            return None
        source = np.array([names.index(name) for name in here], np.intp)
        return source, np.array([self._names.index(name) for name in here], np.intp)
