# SPDX-License-Identifier: Apache-2.0
"""Serialized JointState: its layout, written into a template, read by the generated deserializer.

The generated serializer takes 50 to 120 µs in Python; with fixed names and lengths, only the stamp
and the numbers change from message to message.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import GIGA, HEADER, TIME, CdrWriter
from arm_dynamics.exceptions import InvalidInput

FIELDS = ("position", "velocity", "effort")


class Layout(NamedTuple):
    """Layout of serialized JointStates with the same frame_id, names and lengths.

    Everything is constant from message to message except the stamp, the numbers and the padding,
    which is arbitrary.

    Attributes:
        offsets: Of the numbers of position, velocity and effort.
        mask: 1 for every constant bit, up to the last number.
        bits: Values of the constant bits; the others are 0.
    """

    offsets: tuple[int, ...]
    mask: bytes
    bits: bytes


class _Template(CdrWriter):
    """A message, and 1 for each of its bits but those of the padding."""

    def __init__(self) -> None:
        super().__init__()
        self.mask = bytearray(b"\xff" * HEADER)

    def put(self, piece: bytes, align: int) -> int:
        """Append padding and bytes; return the offset of the latter."""
        offset = super().put(piece, align)
        self.mask += bytes(offset - len(self.mask)) + b"\xff" * len(piece)
        return offset


def layout_of(frame_id: str, names: Sequence[str], lengths: Sequence[int]) -> Layout:
    """Determine the layout; ``lengths`` are those of position, velocity and effort."""
    template = _Template()
    stamp = template.time(0)
    template.text(frame_id)
    template.texts(names)
    offsets = tuple(template.doubles(np.zeros(length)) for length in lengths)
    sizes = (8 * length for length in lengths)
    for offset, size in ((stamp, TIME.size), *zip(offsets, sizes, strict=True)):
        template.mask[offset : offset + size] = bytes(size)
    return Layout(offsets, bytes(template.mask), bytes(template.raw))


class JointStateWriter:
    """A serialized JointState of which only the stamp and the numbers change.

    Attributes:
        names: The joints.
        raw: The message that was written last.
        offsets: Of the numbers of each field.

    Example:
        >>> writer = JointStateWriter(names, ("effort",))
        >>> publisher.publish(writer.write(stamp, tau))
    """

    def __init__(
        self, names: Sequence[str], fields: Sequence[str] = FIELDS, frame_id: str = ""
    ) -> None:
        """Prepare a template; only ``fields`` are sent, the others stay empty."""
        self.names = tuple(names)
        lengths = [len(names) if field in fields else 0 for field in FIELDS]
        layout = layout_of(frame_id, names, lengths)
        self.raw = bytearray(layout.bits)
        self.offsets = [layout.offsets[FIELDS.index(field)] for field in fields]
        raw, size = memoryview(self.raw), 8 * len(names)
        self._numbers = [raw[k : k + size].cast("d") for k in self.offsets]

    def write(self, stamp: int, *arrays: Array) -> bytes:
        """The message with a stamp in [ns] and an array of shape (n,) for each of the fields."""
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
