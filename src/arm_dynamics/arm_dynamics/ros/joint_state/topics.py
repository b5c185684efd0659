# SPDX-License-Identifier: Apache-2.0
"""JointStates of a topic, each in a single C call.

In a loop that wakes up a thousand times a second the processor's caches are cold, and every line
of Python costs several times what it costs in a benchmark. Messages that C does not support, or
finds invalid, are read by ``serialization``, which alone rejects messages.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from ctypes import c_void_p
from functools import cache, partial
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from arm_dynamics.arrays import Array
from arm_dynamics.codegen.header import Header
from arm_dynamics.codegen.kernel import ENTRY
from arm_dynamics.ros.common.cdr import NATIVE
from arm_dynamics.ros.common.direct import Newest, advertise
from arm_dynamics.ros.common.rcl_code import code_of_nodes
from arm_dynamics.ros.interfaces import Topic
from arm_dynamics.ros.joint_state.serialization import (
    FIELDS,
    JointStateReader,
    JointStateWriter,
    Numbers,
    Read,
    layout_of,
    parsed,
)

SOURCE = Path(__file__).with_name("native") / "joint_state.c"
HEADER = Header(SOURCE.with_suffix(".h"), ENTRY)
_OUTCOMES = ("NONE", "KNOWN", "BEYOND", "OTHER", "FAILED")
NONE, KNOWN, BEYOND, OTHER, FAILED = (HEADER.constants[name] for name in _OUTCOMES)
_KINDS = HEADER.constants["KINDS"]


class _State(ctypes.Structure):
    """``joint_state_t`` of joint_state.h."""

    _fields_ = HEADER.fields("joint_state_t")


class Sink(ctypes.Structure):
    """``sink_t`` of joint_state.h."""

    _fields_ = HEADER.fields("sink_t")


@cache
def native() -> ctypes.CDLL:
    """The compiled functions.

    Raises:
        KernelError: If they are not available.
    """
    return code_of_nodes(SOURCE, headers=(HEADER,))


class CompiledReader(JointStateReader):
    """A ``JointStateReader`` that reads messages of known layouts in C.

    Attributes:
        left: Outcome of ``take`` for a message that other compiled code has received and that has
            not been read yet; ``NONE`` if there is none.
    """

    def __init__(
        self, native: ctypes.CDLL, names: Sequence[str], fields: Sequence[str], **options: Any
    ) -> None:
        super().__init__(names, fields, **options)
        n, count = len(names), len(fields)
        self._found = bytearray(24 + 8 * n * count)
        self._unpack = Struct(f"=qqq{n * count}d").unpack_from
        self._numbers = [slice(3 + n * k, 3 + n * (k + 1)) for k in range(count)]
        self._limits = np.array(self._limit)
        self._state = _State(
            fields=count, joints=n, found=address(self._found),
            limit=self._limits.ctypes.data if self._limit else None, gaps=self._gaps,
        )  # fmt: skip
        # For each kind its source, the joints that it names, and what C uses.
        self._kinds: list[tuple[str, frozenset[int], Any]] = []
        self._learned = 0
        self.left, self._memory = NONE, c_void_p(None)
        self._native, self._place = native, c_void_p(ctypes.addressof(self._state))
        self._look = partial(native.look, self._place)

    def read(self, raw: bytes) -> Read:
        """See ``JointStateReader.read``."""
        if (outcome := self._look(raw, len(raw))) <= BEYOND:
            return self._accepted(outcome)[1]
        return self._learn(raw)

    def open(self, subscription: int) -> None:
        """Prepare to receive from an ``rcl_subscription_t``; ``close`` before it is destroyed."""
        self._memory = c_void_p(self._native.source(subscription))
        self.take = partial(self._native.take, self._memory, self._place)

    def next(self) -> int:
        """Outcome of ``take``, or of the pending message."""
        left, self.left = self.left, NONE
        return left or self.take()

    def close(self) -> None:
        """Free the memory for messages."""
        self.take = partial(int, NONE)
        if self._memory:
            self._native.release(self._memory)
            self._memory = c_void_p(None)

    @property
    def places(self) -> tuple[int, int]:
        """Addresses of ``source_t`` and ``joint_state_t``, for other compiled code."""
        return self._memory.value or 0, ctypes.addressof(self._state)

    def whole_from(self, source: str) -> list[bool]:
        """The known kinds that come from a source and name all joints."""
        n = len(self._names)
        return [name == source and len(joints) == n for name, joints, _ in self._kinds]

    def keep(self, numbers: Numbers) -> None:
        """Store the only field of a message that was read elsewhere."""
        self._values = [numbers]

    @property
    def raw(self) -> bytes:
        """The message that was received last."""
        return ctypes.string_at(self._state.raw, self._state.length)

    def taken(self, outcome: int) -> tuple[int, Read] | None:
        """Arrival in [ns] and content of a message, after ``take`` with that outcome."""
        if outcome == NONE:
            return None
        if outcome == OTHER:
            return self._unpack(self._found)[1], self._learn(self.raw)
        return self._accepted(outcome)

    def _accepted(self, outcome: int) -> tuple[int, Read]:
        """Arrival in [ns], and the values that C has read with that outcome."""
        found = self._unpack(self._found)
        source, joints, _ = self._kinds[found[2]]
        self._admit(source, joints)
        values: list[Numbers] = [found[place] for place in self._numbers]
        if len(joints) < len(self._names):
            values = [
                tuple(new[i] if i in joints else old for i, old in enumerate(before))
                for new, before in zip(values, self._values, strict=True)
            ]
        if not self._gaps:
            self._values = values
        if outcome == BEYOND:
            values[0] = self._beyond(values[0])
        return found[1], (found[0], values)

    def _learn(self, raw: bytes) -> Read:
        """Read a message in Python; C reads the next one of its kind."""
        other = self._other
        if isinstance(other, CompiledReader) and (found := other._look(raw, len(raw))) <= BEYOND:
            return other._accepted(found)[1]
        message = parsed(raw)
        reader = self._reader_of(message)
        if isinstance(reader, CompiledReader):
            return reader._take_in(message, raw)
        return reader._checked(message)

    def _take_in(self, message: JointState, raw: bytes) -> Read:
        """Read a message of an unknown kind, and register the kind for C."""
        read = self._checked(message)
        if not raw.startswith(NATIVE):
            return read
        source, places = message.header.frame_id, self._places(message)
        layout = layout_of(source, message.name, [len(getattr(message, f)) for f in FIELDS])
        order = np.array([-1 if place is None else place for place in places], np.int64)
        oldest, joints = self._learned % _KINDS, frozenset(np.flatnonzero(order >= 0).tolist())
        self._kinds[oldest : oldest + 1] = [(source, joints, (order, layout))]
        self._learned += 1
        kind = self._state.kinds[oldest]
        kind.size = len(layout.fixed)
        kind.fixed, kind.expected = (
            ctypes.cast(part, c_void_p).value for part in (layout.fixed, layout.expected)
        )
        kind.at[: len(self._fields)] = [
            layout.places[FIELDS.index(f)] if getattr(message, f) else -1 for f in self._fields
        ]
        kind.place = order.ctypes.data
        return read


class JointStateSource:
    """JointStates of a topic for a loop that polls; no executor is needed.

    Attributes:
        tap: Called with the bytes of every message, if set.
    """

    def __init__(self, node: Node, topic: Topic, reader: CompiledReader) -> None:
        """Subscribe; ``close`` before the node is destroyed."""
        self._newest, self._reader = Newest(node, topic), reader
        self.tap: Callable[[bytes], None] | None = None
        reader.open(self._newest.pointer)

    def take(self) -> tuple[int, Read] | None:
        """Receive the next message; None if there is none.

        Returns:
            The system time of its arrival in [ns], and the result of ``JointStateReader.read``.

        Raises:
            InvalidInput: As ``JointStateReader.read``.
        """
        if (outcome := self._reader.next()) != FAILED:
            if self.tap is not None and outcome != NONE:
                self.tap(self._reader.raw)
            return self._reader.taken(outcome)
        taken = self._newest.take()  # after a failure: gives the reason
        if self.tap is not None and taken is not None:
            self.tap(taken[0])
        return None if taken is None else (taken[1], self._reader.read(taken[0]))

    def close(self) -> None:
        """End the subscription."""
        self._reader.close()
        self._newest.close()


class JointStateSink:
    """Publishes JointStates whose numbers are in persistent arrays.

    Attributes:
        raw: The message that was sent last.
        place: Address of ``sink_t``, for other compiled code.
    """

    def __init__(
        self, node: Node, topic: Topic, writer: JointStateWriter, arrays: Sequence[Array]
    ) -> None:
        """Advertise the topic.

        No other thread may be using it when the node is destroyed.

        Args:
            node: The publishing node.
            topic: The topic.
            writer: Writes the messages.
            arrays: One for each of the writer's fields, contiguous, shape (n,).
        """
        self._handle = advertise(node, topic).handle
        self._writer, self._arrays, self.raw = writer, tuple(arrays), writer.raw
        self._sink = sink = Sink(
            raw=address(writer.raw), size=len(writer.raw), fields=len(writer.places),
            joints=self._arrays[0].size, publisher=self._handle.pointer,
        )  # fmt: skip
        for k, (place, array) in enumerate(zip(writer.places, self._arrays, strict=True)):
            sink.at[k], sink.numbers[k] = place, array.ctypes.data
        self.place = ctypes.addressof(sink)
        self._send = partial(native().send, c_void_p(self.place))

    @property
    def heard(self) -> bool:
        """Whether there are subscribers."""
        return bool(self._handle.get_subscription_count())

    def publish(self, raw: bytes) -> None:
        """Publish a message that was written elsewhere."""
        self._handle.publish_raw(raw)

    def send(self, stamp: int) -> None:
        """Publish the current content of the arrays, with this time in [ns]."""
        if self._send(stamp):  # after a failure: gives the reason
            self._handle.publish_raw(self._writer.write(stamp, *self._arrays))


def make_reader(names: Sequence[str], fields: Sequence[str], **options: Any) -> CompiledReader:
    """A reader in C, see ``JointStateReader``."""
    return CompiledReader(native(), names, fields, **options)


def address(buffer: bytearray) -> int:
    """Address of the bytes of a buffer."""
    return ctypes.addressof(ctypes.c_char.from_buffer(buffer))
