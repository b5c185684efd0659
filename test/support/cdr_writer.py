# SPDX-License-Identifier: Apache-2.0
"""Goals written as CDR bytes, in either byte order; an independent twin of what reads them."""

from __future__ import annotations

import struct
from typing import Any

from nav_msgs.msg import Path
from trajectory_msgs.msg import JointTrajectory


class CdrWriter:
    """Appends one field after another; ``order`` is ``<`` or ``>``."""

    def __init__(self, order: str = "<") -> None:
        self._order = order
        self.raw = bytearray(b"\0\1\0\0" if order == "<" else b"\0\0\0\0")

    def put(self, kind: str, *values: Any) -> None:
        for value in values:
            self.raw += bytes(-(len(self.raw) - 4) % struct.calcsize(kind))
            self.raw += struct.pack(self._order + kind, value)

    def text(self, text: str) -> None:
        encoded = text.encode() + b"\0"
        self.put("I", len(encoded))
        self.raw += encoded

    def doubles(self, values: Any) -> None:
        self.put("I", len(values))
        self.put("d", *values)

    def header(self, header: Any) -> None:
        self.put("i", header.stamp.sec)
        self.put("I", header.stamp.nanosec)
        self.text(header.frame_id)


def trajectory_bytes(message: JointTrajectory, order: str = "<") -> bytes:
    """The message as a machine of this byte order sends it."""
    writer = CdrWriter(order)
    writer.header(message.header)
    writer.put("I", len(message.joint_names))
    for name in message.joint_names:
        writer.text(name)
    writer.put("I", len(message.points))
    for point in message.points:
        for values in (point.positions, point.velocities, point.accelerations, point.effort):
            writer.doubles(values)
        writer.put("i", point.time_from_start.sec)
        writer.put("I", point.time_from_start.nanosec)
    return bytes(writer.raw)


def path_bytes(message: Path, order: str = "<") -> bytes:
    """The message as a machine of this byte order sends it."""
    writer = CdrWriter(order)
    writer.header(message.header)
    writer.put("I", len(message.poses))
    for stamped in message.poses:
        writer.header(stamped.header)
        at, turn = stamped.pose.position, stamped.pose.orientation
        writer.put("d", at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
    return bytes(writer.raw)
