# SPDX-License-Identifier: Apache-2.0
"""Serialized JointState: written into a template, read by the generated deserializer, checked.

The generated serializer takes 50 to 120 µs in Python; with fixed names and lengths, only the stamp
and the numbers change from message to message.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.arrays import Array, any_beyond
from arm_dynamics.exceptions import InvalidInput, choices, known_names
from arm_dynamics.ros.common.cdr import COUNT, GIGA, HEADER, NATIVE, TIME
from arm_dynamics.ros.common.convert import to_nanoseconds

Numbers = tuple[float, ...]
Read = tuple[int, list[Numbers]]  # stamp in [ns], and n numbers for each of the fields

FIELDS = ("position", "velocity", "effort")


class Layout(NamedTuple):
    """Layout of serialized JointStates with the same frame_id, names and lengths.

    Everything is constant from message to message except the stamp, the numbers and the padding,
    which is arbitrary.

    Attributes:
        places: Offsets of the numbers of position, velocity and effort.
        fixed: 1 for every constant bit, up to the last number.
        expected: Values of these bits; the others are 0.
    """

    places: tuple[int, ...]
    fixed: bytes
    expected: bytes


def layout_of(frame_id: str, names: Sequence[str], lengths: Sequence[int]) -> Layout:
    """Determine the layout; ``lengths`` are those of position, velocity and effort."""
    fixed, expected = bytearray(), bytearray()

    def put(piece: bytes, align: int = 1, stays: bool = True) -> int:
        padding = bytes(-(len(expected) - HEADER) % align)
        fixed.extend(padding + (b"\xff" if stays else b"\x00") * len(piece))
        expected.extend(padding + piece)
        return len(expected) - len(piece)

    def count(length: int) -> None:
        put(length.to_bytes(COUNT, sys.byteorder), COUNT)

    def text(value: str) -> None:
        encoded = value.encode() + b"\0"
        count(len(encoded))
        put(encoded)

    def numbers(length: int) -> int:
        count(length)
        return put(bytes(8 * length), 8 if length else 1, stays=False)

    put(NATIVE)
    put(bytes(TIME.size), COUNT, stays=False)
    text(frame_id)
    count(len(names))
    for name in names:
        text(name)
    places = tuple(map(numbers, lengths))
    return Layout(places, bytes(fixed), bytes(expected))


class JointStateWriter:
    """A serialized JointState of which only the stamp and the numbers change.

    Attributes:
        raw: The message that was written last.
        places: Offsets of the numbers of each field.

    Example:
        >>> writer = JointStateWriter(names, ("effort",))
        >>> publisher.publish(writer.write(stamp, tau))
    """

    def __init__(
        self, names: Sequence[str], fields: Sequence[str] = FIELDS, frame_id: str = ""
    ) -> None:
        """Prepare a template; only ``fields`` are sent, the others stay empty."""
        lengths = [len(names) if field in fields else 0 for field in FIELDS]
        layout = layout_of(frame_id, names, lengths)
        self.raw = bytearray(layout.expected)
        self.places = [layout.places[FIELDS.index(field)] for field in fields]
        raw, size = memoryview(self.raw), 8 * len(names)
        self._numbers = [raw[place : place + size].cast("d") for place in self.places]

    def write(self, stamp: int, *arrays: Array) -> bytes:
        """Return the message.

        Args:
            stamp: Time in [ns].
            arrays: One array of float for each of the writer's fields, shape (n,).

        Raises:
            ValueError: If the number or the size of the arrays differs.
        """
        TIME.pack_into(self.raw, HEADER, *divmod(stamp, GIGA))
        for numbers, array in zip(self._numbers, arrays, strict=True):
            numbers[:] = array.data
        return bytes(self.raw)


def parsed(raw: bytes) -> JointState:
    """Deserialize a JointState.

    Raises:
        InvalidInput: If the bytes are not a JointState.
    """
    try:
        return deserialize_message(raw, JointState)
    except Exception as error:
        raise InvalidInput(f"{len(raw)} bytes are not a JointState: {error}") from error


class JointStateReader:
    """Reads numbers in a given order of joints from serialized JointStates."""

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
        gaps: bool = False,
        other: JointStateReader | None = None,
    ) -> None:
        """Configure the reader.

        Args:
            names: Joints, in the order of the numbers read.
            fields: Those of position, velocity and effort that are required.
            partial: Whether joints may be absent; they keep their last values, initially zero.
            extra: Whether joints that are not in ``names`` are ignored.
            admit: Called with the frame_id of each message and the indices of the joints that it
                names, before its numbers are used; may raise InvalidInput.
            limit: Largest magnitudes of the numbers of the first field, n of them; or none.
            beyond: Called with the numbers of the first field if one of them is larger; returns
                the numbers to use instead.
            gaps: Whether numbers, or whole fields, may be missing; they are read as NaN, like
                absent joints.
            other: Reads messages that have a position or velocity instead of this reader.
        """
        self._names, self._fields = list(names), list(fields)
        self._partial, self._extra, self._admit = partial, extra, admit
        self._limit, self._beyond = tuple(limit), beyond
        self._gaps, self._other = gaps, other
        absent = math.nan if gaps else 0.0
        self._values: list[Numbers] = [(absent,) * len(self._names) for _ in fields]

    def read(self, raw: bytes) -> Read:
        """Read a message.

        Args:
            raw: The serialized JointState.

        Returns:
            Its stamp in [ns] and n numbers for each of the fields.

        Raises:
            InvalidInput: If joints or numbers are missing, unknown, repeated or not finite.
        """
        message = parsed(raw)
        return self._reader_of(message)._checked(message)

    def _reader_of(self, message: JointState) -> JointStateReader:
        """The function that reads a message."""
        leads = message.position or message.velocity
        return self._other if leads and self._other is not None else self

    def _checked(self, message: JointState) -> Read:
        places = self._places(message)
        here = frozenset(joint for joint, place in enumerate(places) if place is not None)
        self._admit(message.header.frame_id, here)
        values: list[Numbers] = []
        for field, before in zip(self._fields, self._values, strict=True):
            new = getattr(message, field) or [math.nan] * len(message.name)
            here_or_kept = zip(places, before, strict=True)
            values.append(tuple(old if i is None else new[i] for i, old in here_or_kept))
        for field, numbers in zip(self._fields, values, strict=True):
            for joint, x in zip(self._names, numbers, strict=True):
                if not (math.isfinite(x) or (self._gaps and math.isnan(x))):
                    raise InvalidInput(
                        f"{field} of joint '{joint}' is {x}; allowed: finite numbers"
                    )
        if any_beyond(values[0], self._limit):
            values[0] = self._beyond(values[0])
        if not self._gaps:
            self._values = values
        return to_nanoseconds(message.header.stamp), values

    def _places(self, message: JointState) -> list[int | None]:
        """Check names and lengths; return each joint's index in the message, None if absent."""
        names = list(message.name)
        if len(set(names)) != len(names):
            raise InvalidInput(f"joints {names} are not all different; allowed: each joint once")
        for field in self._fields:
            length = len(getattr(message, field))
            if length != len(names) and not (self._gaps and length == 0):
                raise InvalidInput(
                    f"{field} has {length} numbers for {len(names)} joints; "
                    "allowed: one for each name"
                )
        here = [name for name in names if name in self._names]
        missing = [name for name in self._names if name not in names]
        if len(here) < len(names) and not self._extra:
            unknown = [name for name in names if name not in self._names]
            allowed = choices(unknown[0], self._names)
            raise InvalidInput(f"unknown joints {known_names(unknown)}; allowed: {allowed}")
        if missing and (not here or not self._partial):
            raise InvalidInput(f"joints {known_names(missing)} are missing")
        return [names.index(name) if name in names else None for name in self._names]
