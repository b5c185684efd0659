# SPDX-License-Identifier: Apache-2.0
"""Readers of joint states, beside each other."""

import math

import numpy as np
from sensor_msgs.msg import JointState

from arm_dynamics import InvalidInput
from arm_dynamics.arrays import any_beyond
from arm_dynamics.ros.common.convert import to_nanoseconds
from arm_dynamics.ros.joint_state.reader import JointStateReader, Numbers, Read


class PlainReader(JointStateReader):
    """Takes every number from what ROS's deserializer returns, and none from C."""

    def read_known(self, raw: bytes) -> None:
        """None: no message is known."""

    def read_new(self, message: JointState) -> Read:
        """See ``JointStateReader.read``."""
        message_format = self.format
        kind, values = self._kind_of(message), list[Numbers]()
        self._admit(kind.source, kind.joints)
        for field, before in zip(message_format.fields, self._values, strict=True):
            new = getattr(message, field) or [math.nan] * len(message.name)
            here_or_kept = zip(kind.order, before, strict=True)
            values.append(tuple(old if i < 0 else new[i] for i, old in here_or_kept))
        for field, numbers in zip(message_format.fields, values, strict=True):
            for joint, x in zip(message_format.joints, numbers, strict=True):
                if not (math.isfinite(x) or (message_format.may_have_gaps and math.isnan(x))):
                    raise InvalidInput(
                        f"{field} of joint '{joint}' is {x}; allowed: finite numbers"
                    )
        if self._clip and any_beyond(values[0], self._clip.limit):
            values[0] = self._clip.function(values[0])
        if not message_format.may_have_gaps:
            self._values = values
        return to_nanoseconds(message.header.stamp), values


def said(reader: JointStateReader, raw: bytes) -> object:
    """What a reader makes of a message, bit by bit, or why it does not."""
    try:
        stamp, values = reader.read(raw)
    except InvalidInput as error:
        return str(error)
    return stamp, np.array(values).tobytes()
