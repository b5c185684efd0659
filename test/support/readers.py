# SPDX-License-Identifier: Apache-2.0
"""Readers of joint states, beside each other."""

from __future__ import annotations

import numpy as np

from arm_dynamics import InvalidInput
from arm_dynamics.ros.joint_state.serialization import JointStateReader


def said(reader: JointStateReader, raw: bytes) -> object:
    """What a reader makes of a message, bit by bit, or why it does not."""
    try:
        stamp, values = reader.read(raw)
    except InvalidInput as error:
        return str(error)
    return stamp, np.array(values).tobytes()
