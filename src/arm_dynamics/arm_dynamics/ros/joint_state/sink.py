# SPDX-License-Identifier: Apache-2.0
"""JointStates of a topic, each in a single C call.

In a loop that wakes up a thousand times a second the processor's caches are cold, and every line
of Python costs several times what it costs in a benchmark.
"""

import ctypes
from collections.abc import Sequence
from ctypes import c_void_p
from functools import partial

from rclpy.node import Node

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.addresses import address
from arm_dynamics.ros.common.endpoints import advertise
from arm_dynamics.ros.interfaces import Topic
from arm_dynamics.ros.joint_state.joint_state_library import HEADER, library
from arm_dynamics.ros.joint_state.serialization import JointStateWriter

# ``sink_t`` of joint_state.h
Sink = HEADER.structure("sink_t")


class JointStateSink:
    """Publishes JointStates whose numbers are in persistent arrays.

    Attributes:
        names: The joints.
        raw: The message that was sent last.
        address: Address of ``sink_t``, for other compiled code.
    """

    def __init__(
        self, node: Node, topic: Topic, writer: JointStateWriter, arrays: Sequence[Array]
    ) -> None:
        """Advertise the topic, with a contiguous array of shape (n,) for each written field.

        No other thread may be using it when the node is destroyed.
        """
        self._handle, self.names = advertise(node, topic).handle, writer.names
        self._writer, self._arrays, self.raw = writer, tuple(arrays), writer.raw
        self._sink = sink = Sink(
            raw=address(writer.raw), size=len(writer.raw), fields=len(writer.offsets),
            joints=self._arrays[0].size, publisher=self._handle.pointer,
        )  # fmt: skip
        for k, (offset, array) in enumerate(zip(writer.offsets, self._arrays, strict=True)):
            sink.at[k], sink.numbers[k] = offset, array.ctypes.data
        self.address = ctypes.addressof(sink)
        self._send = partial(library().joint_state_send, c_void_p(self.address))

    @property
    def sender(self) -> bytes:
        """Identifier of this publisher, see ``publishers``."""
        gid = bytearray(ctypes.sizeof(c_void_p) + HEADER.constants["GID"])
        library().publisher_gid(self._handle.pointer, address(gid))
        return bytes(gid[ctypes.sizeof(c_void_p) :])  # a pointer comes first

    @property
    def has_subscribers(self) -> bool:
        """Whether there are subscribers."""
        return bool(self._handle.get_subscription_count())

    def publish(self, raw: bytes) -> None:
        """Publish a message that was written elsewhere."""
        self._handle.publish_raw(raw)

    def send(self, stamp: int) -> None:
        """Publish the current content of the arrays, with this time in [ns]."""
        if self._send(stamp):  # after a failure: gives the reason
            self._handle.publish_raw(self._writer.write(stamp, *self._arrays))
