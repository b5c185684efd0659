# SPDX-License-Identifier: Apache-2.0
"""Conversion between messages and bytes, times, arrays."""

from array import array
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message

from arm_dynamics.cdr import GIGA


def as_bytes(message: Any) -> bytes:
    """Serialize a message, unless it is serialized already."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


def to_time(stamp: int) -> Time:
    """Convert a stamp in [ns] to a Time message."""
    seconds, nanoseconds = divmod(stamp, GIGA)
    return Time(sec=seconds, nanosec=nanoseconds)


def to_nanoseconds(message: Any) -> int:
    """Convert a Time or Duration message to [ns]."""
    return int(message.sec) * GIGA + int(message.nanosec)


def to_array(values: Any) -> array[float]:
    """Convert numbers to the type of message fields, row after row."""
    return array("d", np.ascontiguousarray(values, float).tobytes())
