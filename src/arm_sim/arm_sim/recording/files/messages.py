# SPDX-License-Identifier: Apache-2.0
"""The messages in the suite's files: definitions, and serialization without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import HEADER, CdrReader, CdrWriter
from arm_dynamics.exceptions import InvalidInput

JOINT_STATE, TICK = "sensor_msgs/msg/JointState", "arm_msgs/msg/Tick"
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


class TickWriter:
    """A serialized ``arm_msgs/Tick`` in which only stamp and numbers change.

    Attributes:
        raw: The message.
        stamp: Offset of its stamp.
        state: Bytes of (q, v, z).
        command: Bytes of the command.
        notes: Bytes of the error and the number of time-stepped ticks.
        hold: Offset of the field ``hold``.
    """

    def __init__(self, nx: int, n: int) -> None:
        writer = CdrWriter()
        self.stamp = writer.time(0)
        writer.text("")
        state, command = writer.doubles(np.zeros(nx)), writer.doubles(np.zeros(n))
        notes = writer.array(np.zeros(2))
        self.hold = writer.put(b"\0", 1)
        self.raw, self.places = writer.raw, (state, command, notes)
        view = memoryview(self.raw)
        self.state, self.command = view[state : state + 8 * nx], view[command : command + 8 * n]
        self.notes = view[notes : notes + 16]


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


class JointStateWriter:
    """A serialized JointState in which only stamp and numbers change.

    Attributes:
        raw: The message.
        stamp: Offset of its stamp.
        places: Offsets of the numbers of position, velocity and effort.
    """

    def __init__(self, names: Sequence[str]) -> None:
        writer = CdrWriter()
        self.stamp = writer.time(0)
        writer.text("")
        writer.texts(names)
        self.places = tuple(writer.doubles(np.zeros(len(names))) for _ in range(3))
        self.raw = writer.raw


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


def numbers_at(rows: np.ndarray, place: int, count: int) -> Array:
    """Copy ``count`` numbers at an offset of messages of the same layout, shape (k, count)."""
    return np.ascontiguousarray(rows[:, place : place + 8 * count]).view(float)


def stamps_at(rows: np.ndarray, place: int) -> np.ndarray:
    """The stamps at an offset of messages of the same layout in [ns], shape (k,)."""
    parts = np.ascontiguousarray(rows[:, place : place + 8])
    seconds = parts[:, :4].copy().view(np.int32)[:, 0].astype(np.int64)
    return seconds * 1_000_000_000 + parts[:, 4:].copy().view(np.uint32)[:, 0]


def tick_sizes(raw: bytes) -> tuple[int, int]:
    """Lengths of state and command in an ``arm_msgs/Tick``, or raise InvalidInput."""
    reader = CdrReader(raw)
    reader.nanoseconds()
    reader.text()
    sizes = reader.doubles().size, reader.doubles().size
    if raw[:HEADER] != TickWriter(*sizes).raw[:HEADER] or len(raw) != len(TickWriter(*sizes).raw):
        raise InvalidInput("ticks of a machine with another byte order cannot be read here")
    return sizes
