# SPDX-License-Identifier: Apache-2.0
"""The messages in the suite's files: definitions, and serialization without ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from arm_dynamics.arrays import Array
from arm_dynamics.cdr import GIGA, HEADER, NATIVE, CdrReader, CdrWriter
from arm_dynamics.exceptions import InvalidInput

JOINT_STATE, TICK = "sensor_msgs/msg/JointState", "arm_msgs/msg/Tick"
# The quantities of a joint state
PARTS = ("position", "velocity", "effort")
CHANGE, LOG, STRING = "arm_msgs/msg/Change", "rcl_interfaces/msg/Log", "std_msgs/msg/String"
# Quality of service of a latched topic (transient local), as rosbag2 writes it
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


class _Kind(NamedTuple):
    """Serialization of a type of field."""

    default: Any
    write: Callable[[CdrWriter, Any], Any]  # returns the offset
    read: Callable[[CdrReader], Any]


_KINDS = {
    "builtin_interfaces/Time": _Kind(0, CdrWriter.time, CdrReader.nanoseconds),
    "string": _Kind("", CdrWriter.text, CdrReader.text),
    "string[]": _Kind((), CdrWriter.texts, lambda reader: tuple(reader.texts())),
    "float64[]": _Kind(np.zeros(0), CdrWriter.doubles, CdrReader.doubles),
    "float64": _Kind(
        0.0, lambda writer, x: writer.array(np.array([x])),
        lambda reader: float(reader.array(1)[0]),
    ),
    "uint8": _Kind(0, lambda writer, x: writer.put(bytes([x]), 1), CdrReader.byte),
    "uint32": _Kind(0, CdrWriter.count, CdrReader.count),
}  # fmt: skip


@cache
def _fields(kind: str) -> dict[str, str]:
    """Types of the fields of a type, with those of its header, by name."""
    lines = _OWN[kind].replace("std_msgs/Header header", _HEADER).splitlines()
    return {name: type_ for type_, name in (line.split() for line in lines if "=" not in line)}


def _laid_out(kind: str, values: dict[str, Any]) -> tuple[bytes, dict[str, int]]:
    """A serialized message, and the offset of each field."""
    writer, places = CdrWriter(), dict[str, int]()
    for name, type_ in _fields(kind).items():
        field = _KINDS[type_]
        places[name] = field.write(writer, values.get(name, field.default))
    return bytes(writer.raw), places


def written(kind: str, **values: Any) -> bytes:
    """Serialize a message of a type from its fields; times are in [ns]."""
    return _laid_out(kind, values)[0]


def read(kind: str, raw: bytes) -> Any:
    """Read a serialized message of a type; its fields are attributes, times in [ns].

    Raises:
        InvalidInput: If the bytes are something else.
    """
    reader, fields = CdrReader(raw), _fields(kind).items()
    return SimpleNamespace(**{name: _KINDS[type_].read(reader) for name, type_ in fields})


class JointState(NamedTuple):
    """A joint state, as far as recordings need it; its stamp is in [ns]."""

    stamp: int
    name: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array


def read_joint_state(raw: bytes) -> JointState:
    """Read a serialized joint state; errors are those of ``read``."""
    fields = vars(read(JOINT_STATE, raw))
    return JointState(**{name: fields[name] for name in JointState._fields})


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
    def of(cls, kind: str, sizes: dict[str, int], **constant: Any) -> Layout:
        """A layout of a type; arrays have ``sizes``, and other fields are ``constant``."""
        arrays = {name: np.zeros(size) for name, size in sizes.items()}
        raw, places = _laid_out(kind, arrays | constant)
        kinds: dict[str, Any] = {
            "builtin_interfaces/Time": (np.int32, 2), "float64": float, "uint8": np.uint8
        }  # fmt: skip
        types = {name: kinds.get(type_) for name, type_ in _fields(kind).items()}
        types |= {name: (float, size) for name, size in sizes.items()}
        names = [name for name, type_ in types.items() if type_ is not None]
        fields: Any = {
            "names": names, "formats": [types[name] for name in names],
            "offsets": [places[name] for name in names], "itemsize": len(raw),
        }  # fmt: skip
        return cls(raw, np.dtype(fields))

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
                "time steps of the recording are not all of the same robot, or of a machine with "
                "another byte order"
            )
        return np.frombuffer(b"".join(raws), self.fields)


def tick_layout(nx: int, n: int) -> Layout:
    """Of ticks with states of shape (nx,) and commands of shape (n,)."""
    return Layout.of(TICK, {"state": nx, "command": n})


def joint_state_layout(names: Sequence[str]) -> Layout:
    """Of complete joint states."""
    return Layout.of(JOINT_STATE, dict.fromkeys(PARTS, len(names)), name=names)
