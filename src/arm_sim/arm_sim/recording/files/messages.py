# SPDX-License-Identifier: Apache-2.0
"""The messages in the suite's files: definitions, and serialization without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import GIGA, HEADER, NATIVE, CdrReader, CdrWriter
from arm_dynamics.exceptions import InvalidInput

JOINT_STATE, TICK = "sensor_msgs/msg/JointState", "arm_msgs/msg/Tick"
PARTS = ("position", "velocity", "effort")
"""The quantities of a joint state."""
CHANGE, LOG, STRING = "arm_msgs/msg/Change", "rcl_interfaces/msg/Log", "std_msgs/msg/String"
LATCHED = """- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
"""Quality of service of a latched topic (transient local), as rosbag2 writes it."""

_TIME = "int32 sec\nuint32 nanosec"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id"
_PARTS = {"builtin_interfaces/Time": _TIME, "std_msgs/Header": _HEADER}
_OWN = {
    JOINT_STATE: "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
    "float64[] velocity\nfloat64[] effort",
    TICK: "uint8 FREE=0\nuint8 BRAKES=1\nuint8 SERVOS=2\nstd_msgs/Header header\n"
    "float64[] state\nfloat64[] command\nfloat64 error\nfloat64 time_stepped\nuint8 hold",
    CHANGE: "std_msgs/Header header\nstring text\nstring[] tunable\nfloat64[] parameters\n"
    "float64[] state\nfloat64 substep\nfloat64 error\nfloat64 time_stepped",
    LOG: "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
    "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
    "string function\nuint32 line",
    STRING: "string data",
}


def definition(kind: str) -> str:
    """The definition of a type and of all types that it contains, in the format of ROS bags."""
    own = _OWN[kind]
    used = [name for name in _PARTS if any(name in text for text in (own, _HEADER))]
    parts = [f"\n{'=' * 80}\nMSG: {name}\n{_PARTS[name]}" for name in used if kind != STRING]
    return "".join([own, *parts])


@dataclass(frozen=True)
class Layout:
    """Messages of a type that differ in their stamp and numbers only.

    Attributes:
        raw: One of them, with zeros there.
        fields: Its stamp, (sec, nanosec), and its numbers, by name.
    """

    raw: bytes
    fields: np.dtype[np.void]

    @classmethod
    def of(cls, raw: bytearray, **places: tuple[int, Any]) -> Layout:
        """A layout from the place and the NumPy type of each of its numbers."""
        offsets, kinds = zip((HEADER, (np.int32, 2)), *places.values(), strict=True)
        names = ["stamp", *places]
        fields: Any = {
            "names": names, "formats": kinds, "offsets": offsets, "itemsize": len(raw)
        }  # fmt: skip
        return cls(bytes(raw), np.dtype(fields))

    def place(self, name: str) -> int:
        """Offset of a number."""
        assert self.fields.fields is not None
        return self.fields.fields[name][1]

    def written(self, stamps: NDArray[np.int64], **numbers: Any) -> list[bytes]:
        """Messages with stamps in [ns], shape (k,), and numbers, shapes (k, …)."""
        size, data = len(self.raw), bytearray(self.raw * len(stamps))
        rows = np.frombuffer(data, self.fields)
        rows["stamp"] = np.column_stack(np.divmod(stamps, GIGA))
        for name, values in numbers.items():
            rows[name] = values
        return [bytes(data[at : at + size]) for at in range(0, len(data), size)]

    def read(self, raws: Sequence[bytes]) -> NDArray[np.void]:
        """Numbers of messages by name, shape (k,).

        Raises:
            InvalidInput: If they are of another layout.
        """
        if any(len(raw) != len(self.raw) or raw[:HEADER] != NATIVE for raw in raws):
            raise InvalidInput(
                "the ticks of the recording are not all of the same robot, or of a machine with "
                "another byte order"
            )
        return np.frombuffer(b"".join(raws), self.fields)


def tick_layout(nx: int, n: int) -> Layout:
    """``arm_msgs/Tick``: ``state``, ``command``, ``notes`` (error, time-stepped), ``hold``."""
    writer = CdrWriter()
    writer.time(0)
    writer.text("")
    state = writer.doubles(np.zeros(nx)), (float, nx)
    command = writer.doubles(np.zeros(n)), (float, n)
    notes, hold = (writer.array(np.zeros(2)), (float, 2)), (writer.put(b"\0", 1), np.uint8)
    return Layout.of(writer.raw, state=state, command=command, notes=notes, hold=hold)


def joint_state_layout(names: Sequence[str]) -> Layout:
    """``sensor_msgs/JointState``: ``position``, ``velocity``, ``effort``."""
    writer, n = CdrWriter(), len(names)
    writer.time(0)
    writer.text("")
    writer.texts(names)
    places = {part: (writer.doubles(np.zeros(n)), (float, n)) for part in PARTS}
    return Layout.of(writer.raw, **places)


@dataclass(frozen=True)
class Change:
    """The complete state after a change other than by a tick.

    Attributes:
        stamp: Simulated time in [ns].
        text: Reason of the change.
        tunable: Names of the tunable quantities.
        p: Their values, shape (np,).
        x: State (q, v, z), shape (nx,).
        notes: Next trial sub-step of the error control in [s], error, and number of time-stepped
            ticks.
    """

    stamp: int
    text: str
    tunable: tuple[str, ...]
    p: Array
    x: Array
    notes: tuple[float, float, float]

    def written(self) -> bytes:
        """Serialize as ``arm_msgs/Change``."""
        writer = CdrWriter()
        writer.time(self.stamp)
        writer.text("")
        writer.text(self.text)
        writer.texts(self.tunable)
        writer.doubles(self.p)
        writer.doubles(self.x)
        writer.array(np.array(self.notes))
        return bytes(writer.raw)

    @classmethod
    def read(cls, raw: bytes) -> Change:
        """Read a serialized one.

        Raises:
            InvalidInput: If the bytes are something else.
        """
        reader = CdrReader(raw)
        stamp = reader.nanoseconds()
        reader.text()
        text, tunable = reader.text(), tuple(reader.texts())
        p, x = reader.doubles(), reader.doubles()
        substep, error, stepped = reader.array(3).tolist()
        return cls(stamp, text, tunable, p, x, (substep, error, stepped))


def log_message(stamp: int, level: int, name: str, text: str) -> bytes:
    """An ``rcl_interfaces/Log``."""
    writer = CdrWriter()
    writer.time(stamp)
    writer.put(bytes([level]), 1)
    for part in (name, text, "", ""):
        writer.text(part)
    writer.count(0)
    return bytes(writer.raw)


def log_text(raw: bytes) -> tuple[int, str]:
    """Stamp in [ns] and text of an ``rcl_interfaces/Log``."""
    reader = CdrReader(raw)
    stamp = reader.nanoseconds()
    reader.skip(1, 1)
    reader.text()
    return stamp, reader.text()


def string_message(text: str) -> bytes:
    """A ``std_msgs/String``."""
    writer = CdrWriter()
    writer.text(text)
    return bytes(writer.raw)


@dataclass(frozen=True)
class JointStates:
    """A JointState that was read; arrays may be empty."""

    stamp: int
    names: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array

    @classmethod
    def read(cls, raw: bytes) -> JointStates:
        """Read a serialized one, or raise InvalidInput."""
        reader = CdrReader(raw)
        stamp = reader.nanoseconds()
        reader.text()
        names = tuple(reader.texts())
        return cls(stamp, names, reader.doubles(), reader.doubles(), reader.doubles())
