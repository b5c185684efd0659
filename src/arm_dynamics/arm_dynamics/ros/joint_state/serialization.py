# SPDX-License-Identifier: Apache-2.0
"""JointState as bytes: joined from pieces that stay, read by looking at known places.

A generated serializer takes 50 to 120 µs in Python; with names and lengths fixed, all that changes
from message to message is the stamp and the numbers.
"""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, NoReturn

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.arrays import Array, any_beyond, finite_numbers
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.ros.common.cdr import COUNT, GIGA, HEADER, TIME, CdrReader, time_bytes

Numbers = tuple[float, ...]
Read = tuple[int, list[Numbers]]  # stamp in [ns], and n numbers for each of the fields

FIELDS = ("position", "velocity", "effort")
NATIVE = b"\x00\x01\x00\x00" if sys.byteorder == "little" else b"\x00\x00\x00\x00"
_KINDS = 4  # layouts kept at once, for several publishers on one topic


class Layout(NamedTuple):
    """Where things stand in a serialized JointState.

    Attributes:
        size: Bytes up to the last number.
        arrays: Offset and length of position, velocity and effort.
        record: Takes a message apart: the two numbers of the stamp, then those of the arrays.
        numbers: Places in the record of position, velocity and effort.
        fixed: 1 for every bit that is the same in all messages of this layout, as one integer.
        expected: What these bits are.
    """

    size: int
    arrays: tuple[tuple[int, int], ...]
    record: struct.Struct
    numbers: tuple[slice, ...]
    fixed: int
    expected: int

    def read(self, raw: bytes) -> tuple[Any, ...] | None:
        """Take ``raw`` apart by the record; None if it has another layout."""
        size = self.size
        if len(raw) < size or int.from_bytes(raw[:size], "little") & self.fixed != self.expected:
            return None
        return self.record.unpack_from(raw)

    def masks(self) -> tuple[bytes, bytes]:
        """``fixed`` and ``expected`` byte by byte."""
        return self.fixed.to_bytes(self.size, "little"), self.expected.to_bytes(
            self.size, "little"
        )

    def array(self, raw: bytes | bytearray, field: int) -> Array:
        """View the numbers of one field in place."""
        offset, length = self.arrays[field]
        return np.frombuffer(raw, np.float64, length, offset)


def layout_of(raw: bytes) -> Layout:
    """Find out where things stand in a serialized JointState by walking over it.

    What stays from message to message is everything but the stamp, the numbers and the padding,
    which may hold anything.
    """
    cdr, mask, arrays = CdrReader(raw), bytearray(len(raw)), []

    def stays(size: int) -> None:
        mask[cdr.at - size : cdr.at] = b"\xff" * size

    def count() -> int:
        length = cdr.count()
        stays(COUNT)
        return length

    def text() -> None:
        length = count()
        cdr.skip(length, 1)
        stays(length)

    stays(HEADER)
    cdr.skip(TIME.size, COUNT)
    text()  # frame_id
    for _ in range(count()):
        text()
    for _ in FIELDS:
        length = count()
        arrays.append((cdr.skip(8 * length, 8 if length else 1), length))
    form, at, place, numbers = f"={HEADER}xiI", HEADER + TIME.size, 2, []
    for start, length in arrays:
        form += f"{start - at}x{length}d"
        numbers.append(slice(place, place + length))
        at, place = start + 8 * length, place + length
    fixed = int.from_bytes(mask[: cdr.at], "little")
    expected = int.from_bytes(raw[: cdr.at], "little") & fixed
    return Layout(cdr.at, tuple(arrays), struct.Struct(form), tuple(numbers), fixed, expected)


class JointStateWriter:
    """A serialized JointState of which only the stamp and the numbers change.

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
        layout = layout_of(serialize_message(message))
        clean = layout.expected.to_bytes(layout.size, "little")  # no rubbish in the padding
        # What one call joins: the stamp, and numbers after each piece of what stays.
        self._parts: list[Any] = [clean[:HEADER], b""]
        at = HEADER + TIME.size
        for field in fields:
            start, length = layout.arrays[FIELDS.index(field)]
            self._parts += [clean[at:start], b""]
            at = start + 8 * length
        self._parts.append(clean[at:])
        self._numbers = slice(3, 3 + 2 * len(fields), 2)
        self._size = layout.size

    def write(self, stamp: int, *arrays: Array) -> bytes:
        """Return the message.

        Args:
            stamp: Time in [ns].
            arrays: One array for each of the writer's fields, contiguous, shape (n,).

        Raises:
            ValueError: If the number or the size of the arrays is another one.
        """
        parts = self._parts
        parts[1] = time_bytes(stamp)
        parts[self._numbers] = arrays
        raw = b"".join(parts)
        if len(raw) != self._size:
            raise ValueError(f"arrays of {sum(map(np.size, arrays))} numbers do not fit")
        return raw


class Known(NamedTuple):
    """A layout that was met.

    Attributes:
        numbers: Places in a record of the numbers that are read, one for each field.
        places: Where in the message each joint is, None for an absent one; None: all, in order.
        source: The header's frame_id.
        joints: Indices of the joints that it names.
    """

    layout: Layout
    numbers: tuple[slice, ...]
    places: tuple[int | None, ...] | None
    source: str
    joints: frozenset[int]


class JointStateReader:
    """Reads numbers in a given order of joints out of serialized JointStates.

    The first message of a kind is read by the generated deserializer and checked; the following
    ones with the same names and lengths are read by looking at the same places.

    Attributes:
        fields: Places of the fields that are read in ``FIELDS``.
        latest: The layout of the message that was read last here, None before.
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
        limit: Sequence[float] = (),
        beyond: Callable[[Numbers], Numbers] = lambda numbers: numbers,
    ) -> None:
        """Choose what to read.

        Args:
            names: Joints, in the order of the numbers read.
            fields: Those of position, velocity and effort that must be there.
            partial: Whether joints may be absent; those keep what was read before, at first zero.
            extra: Whether joints that are not in ``names`` are passed over.
            admit: Called with the frame_id of each message and the indices of the joints that it
                names, before its numbers count; may raise InvalidInput.
            limit: How large the numbers of the first field may be, n of them; or none.
            beyond: Called with the numbers of the first field when one of them is larger; returns
                those to take instead.
        """
        self._names, self.fields = list(names), [FIELDS.index(field) for field in fields]
        self._partial, self._extra, self._admit = partial, extra, admit
        self._limit, self._beyond = tuple(limit), beyond
        self._values: list[Numbers] = [(0.0,) * len(self._names) for _ in fields]
        self._known: list[Known] = []
        self.latest: Known | None = None
        self.slow_reads = 0

    def read(self, raw: bytes) -> Read:
        """Read a message.

        Args:
            raw: The serialized JointState.

        Returns:
            Its stamp in [ns] and n numbers for each of the fields.

        Raises:
            InvalidInput: If joints or numbers are missing, unknown, doubled or not finite.
        """
        for known in self._known:
            if (found := known.layout.read(raw)) is not None:
                break
        else:
            known, found = self._learn(raw)
        self.latest = known
        self._admit(known.source, known.joints)
        values: list[Numbers] = [found[place] for place in known.numbers]
        if known.places is not None:
            values = [
                tuple(
                    old if i is None else new[i]
                    for i, old in zip(known.places, before, strict=True)
                )
                for new, before in zip(values, self._values, strict=True)
            ]
        if not all(map(finite_numbers, values)):
            self._refuse_infinite(values)
        if any_beyond(values[0], self._limit):
            values[0] = self._beyond(values[0])
        self._values = values
        return found[0] * GIGA + found[1], values

    def _refuse_infinite(self, values: list[Numbers]) -> NoReturn:
        field, joint, bad = next(
            (FIELDS[field], joint, x)
            for field, numbers in zip(self.fields, values, strict=True)
            for joint, x in zip(self._names, numbers, strict=True)
            if not math.isfinite(x)
        )
        raise InvalidInput(f"{field} of joint '{joint}' is {bad}; allowed are finite numbers")

    def _learn(self, raw: bytes) -> tuple[Known, tuple[Any, ...]]:
        """Take the long way, check the message and remember where things stand in it."""
        self.slow_reads += 1
        try:
            message = deserialize_message(raw, JointState)
            if not raw.startswith(NATIVE):  # from a machine of the other endianness
                raw = serialize_message(message)
        except Exception as error:
            raise InvalidInput(f"{len(raw)} bytes are not a JointState: {error}") from error
        places = self._places(message)
        all_of_them = range(len(self._names))
        joints = [k for k in all_of_them if places is None or places[k] is not None]
        source = message.header.frame_id
        layout = layout_of(raw)
        numbers = tuple(layout.numbers[field] for field in self.fields)
        known = Known(layout, numbers, places, source, frozenset(joints))
        for field, name in enumerate(FIELDS):
            if layout.array(raw, field).tobytes() != getattr(message, name).tobytes():
                raise InvalidInput(f"{name} of the message is not where CDR puts it")
        self._known = [known, *self._known[: _KINDS - 1]]
        return known, layout.record.unpack_from(raw)

    def _places(self, message: JointState) -> tuple[int | None, ...] | None:
        """Check names and lengths; say where in the message each joint is."""
        names = list(message.name)
        if len(set(names)) != len(names):
            raise InvalidInput(f"joints {names} are not all different; allowed is each once")
        for field in self.fields:
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
        return tuple(names.index(name) if name in names else None for name in self._names)
