# SPDX-License-Identifier: Apache-2.0
"""Serialization of messages; the rest is in ``arm_dynamics.cdr``."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import serialize_message


def as_bytes(message: Any) -> bytes:
    """Serialize a message, unless it is serialized already."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))
