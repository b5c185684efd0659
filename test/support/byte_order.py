# SPDX-License-Identifier: Apache-2.0
"""Messages as a machine of either byte order sends them, by ``rosbags``."""

from array import array
from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = cache(lambda: get_typestore(Stores.ROS2_JAZZY))


def sent(message: Any, order: str = "<") -> bytes:
    """The bytes of a message; ``order`` is ``<`` or ``>``."""
    made = STORE().serialize_cdr(_twin(message), _kind(message), little_endian=order == "<")
    return bytes(made)


def _kind(message: Any) -> str:
    return f"{type(message).__module__.partition('.')[0]}/msg/{type(message).__name__}"


def _twin(value: Any) -> Any:
    if isinstance(value, list | array):
        return np.array(value) if isinstance(value, array) else [_twin(one) for one in value]
    if not hasattr(value, "get_fields_and_field_types"):
        return value
    fields = (_twin(getattr(value, name)) for name in value.get_fields_and_field_types())
    return STORE().types[_kind(value)](*fields)
