# SPDX-License-Identifier: Apache-2.0
"""Readers of joint states, beside each other."""

from __future__ import annotations

import math

import numpy as np
from sensor_msgs.msg import JointState

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import any_beyond
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.joint_state.reader import JointStateReader, Numbers, Read
from arm_dynamics.ros.joint_state.serialization import parsed


class PlainReader(JointStateReader):
    """Takes every number from what ROS's deserializer returns, and none from C."""

    def read(self, raw: bytes) -> Read:
        """See ``JointStateReader.read``."""
        message = parsed(raw)
        leads = message.position or message.velocity
        reader = self._other if leads and self._other is not None else self
        return reader._plain(message)

    def _plain(self, message: JointState) -> Read:
        kind, values = self._kind_of(message), list[Numbers]()
        self._admit(kind.source, kind.joints)
        for field, before in zip(self._fields, self._values, strict=True):
            new = getattr(message, field) or [math.nan] * len(message.name)
            here_or_kept = zip(kind.order, before, strict=True)
            values.append(tuple(old if i < 0 else new[i] for i, old in here_or_kept))
        for field, numbers in zip(self._fields, values, strict=True):
            for joint, x in zip(self._names, numbers, strict=True):
                if not (math.isfinite(x) or (self._gaps and math.isnan(x))):
                    raise InvalidInput(
                        f"{field} of joint '{joint}' is {x}; allowed: finite numbers"
                    )
        if any_beyond(values[0], self._limit.tolist()):
            values[0] = self._beyond(values[0])
        if not self._gaps:
            self._values = values
        return to_nanoseconds(message.header.stamp), values


def said(reader: JointStateReader, raw: bytes) -> object:
    """What a reader makes of a message, bit by bit, or why it does not."""
    try:
        stamp, values = reader.read(raw)
    except InvalidInput as error:
        return str(error)
    return stamp, np.array(values).tobytes()
