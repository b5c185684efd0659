# SPDX-License-Identifier: Apache-2.0
"""Message types by the names used in the ROS graph and in files."""

from __future__ import annotations

import importlib
from typing import Any


def type_of(kind: str) -> Any:
    """The class of a type such as ``sensor_msgs/msg/JointState``; None if it is not installed."""
    package, _, rest = kind.partition("/")
    try:
        module = importlib.import_module(  # noqa: TID251 - a name that files and the graph tell
            f"{package}.{rest.rpartition('/')[0].replace('/', '.') or 'msg'}"
        )
        return getattr(module, kind.rpartition("/")[2])
    except (ImportError, AttributeError, ValueError):
        return None
