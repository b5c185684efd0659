# SPDX-License-Identifier: Apache-2.0
"""Reads numbers from serialized JointStates, in C.

The first message of a kind is parsed by ROS's deserializer: its names and lengths are checked, and
its layout is passed to C, which reads it and all that follow. Why a message is refused is
determined here.
"""

import ctypes
import math
from collections.abc import Callable, Sequence
from ctypes import c_void_p
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.exceptions import InvalidInput
from arm_dynamics.ros.joint_state.format import JointStateFormat
from arm_dynamics.ros.joint_state.joint_state_library import HEADER, library
from arm_dynamics.ros.joint_state.serialization import FIELDS, Layout, layout_of, parsed
from arm_dynamics.scene.urdf.joint_names import TOLERANCE

Numbers = tuple[float, ...]
Admit = Callable[[str, frozenset[int]], None]
Read = tuple[int, list[Numbers]]  # stamp in [ns], and n numbers for each of the fields

_OUTCOMES = ("NONE", "KNOWN", "BEYOND", "FAILED")
NONE, KNOWN, BEYOND, FAILED = (HEADER.constants[name] for name in _OUTCOMES)
_KINDS = HEADER.constants["KINDS"]
_FOLLOWER = np.dtype(HEADER.structure("follower_t"))


class Clip(NamedTuple):
    """Limits of the first field."""

    limit: Sequence[float]  # largest magnitude of each joint
    function: Callable[[Numbers], Numbers]  # returns numbers to use instead of some beyond


class _Kind(NamedTuple):
    """A kind of message: its source, the joints that it names, and what C reads it by.

    ``order`` has the index of each expected joint in it, -1 if absent; ``followers`` are those of
    joint_state.h.
    """

    source: str
    joints: frozenset[int]
    layout: Layout
    order: NDArray[np.int64]
    followers: NDArray[np.void]


class JointStateReader:
    """Reads numbers in the order of the joints; joints that a message lacks keep their last ones.

    At first these are zero. In a format that may have gaps, missing numbers are NaN.
    """

    def __init__(
        self, message_format: JointStateFormat, admit: Admit = lambda source, joints: None,
        clip: Clip | None = None,
    ) -> None:  # fmt: skip
        """Configure the reader.

        Args:
            message_format: Joints and fields of the messages.
            admit: Called with the frame_id of each message and the indices of the joints that it
                names, before its numbers are used; may raise InvalidInput.
            clip: Limits of the first field.
        """
        self.format, self._admit, self._clip = message_format, admit, clip
        self._n, count = len(message_format.joints), len(message_format.fields)
        absent = math.nan if message_format.may_have_gaps else 0.0
        self._values: list[Numbers] = [(absent,) * self._n] * count
        self._numbers = np.zeros((count, self._n))
        self._limit = np.array(() if clip is None else clip.limit, float)
        self._state = HEADER.structure("joint_state_t")(
            fields=count, joints=self._n, numbers=self._numbers.ctypes.data,
            limit=None if clip is None else self._limit.ctypes.data,
            gaps=message_format.may_have_gaps,
        )  # fmt: skip
        self._kinds, self._kind_count = list[_Kind](), 0  # the last ones; all so far
        self._memory = c_void_p(None)
        self._native, self._address = library(), c_void_p(ctypes.addressof(self._state))
        self._read = partial(self._native.joint_state_read, self._address)

    def read(self, raw: bytes) -> Read:
        """The stamp in [ns] of a serialized JointState, and n numbers for each of the fields.

        Raises:
            InvalidInput: If joints or numbers are missing, unknown, repeated or not finite.
        """
        values = self.read_known(raw)
        return self.read_new(parsed(raw)) if values is None else values

    def read_known(self, raw: bytes) -> Read | None:
        """Read a message of a kind that C knows; None if C does not accept it."""
        if (outcome := self._read(raw, len(raw))) > BEYOND:
            return None
        kind = self._kinds[self._state.kind]
        self._admit(kind.source, kind.joints)
        return self._take_values(kind, outcome)

    def read_new(self, message: JointState) -> Read:
        """Read a message that C does not accept, and pass its kind to C."""
        kind = self._kind_of(message)
        if all(kind.layout != known.layout for known in self._kinds):
            self._register(kind, message)  # admitted or not: a rival may send as often as a leader
        self._admit(kind.source, kind.joints)
        raw = bytes(serialize_message(message))  # in this machine's byte order
        if (outcome := self._read(raw, len(raw))) <= BEYOND:
            return self._take_values(kind, outcome)
        self.format.check_numbers(message)
        raise InvalidInput(f"the JointState of '{message.header.frame_id}' cannot be read")

    def open(self, subscription: int) -> None:
        """Prepare to receive from an ``rcl_subscription_t``; ``close`` before it is destroyed."""
        self._memory = c_void_p(self._native.joint_state_source(subscription))
        self.take = partial(self._native.joint_state_take, self._memory, self._address)

    def close(self) -> None:
        """Free the memory for messages."""
        self.take = partial(int, NONE)
        if self._memory:
            self._native.joint_state_source_free(self._memory)
            self._memory = c_void_p(None)

    @property
    def addresses(self) -> tuple[int, int]:
        """Addresses of ``source_t`` and ``joint_state_t``, for other compiled code."""
        return self._memory.value or 0, ctypes.addressof(self._state)

    def complete_kinds(self, source: str) -> list[bool]:
        """Which of the known kinds come from a source and name all joints."""
        return [kind.source == source and len(kind.joints) == self._n for kind in self._kinds]

    def store(self, numbers: Numbers) -> None:
        """Store the only field of a message that was read elsewhere."""
        self._values = [numbers]

    @property
    def raw(self) -> bytes:
        """The message that was received last."""
        return ctypes.string_at(self._state.raw, self._state.length)

    @property
    def sender(self) -> bytes:
        """Identifier of its publisher, see ``publishers``; zeros if it was received elsewhere."""
        return bytes(self._state.sender)

    @property
    def arrival(self) -> int:
        """System time in [ns] at which it arrived."""
        return int(self._state.arrival)

    def _take_values(self, kind: _Kind, outcome: int) -> Read:
        """Keep the numbers that C has read, and return them with the stamp, clipped."""
        values: list[Numbers] = [tuple(row) for row in self._numbers.tolist()]
        if len(kind.joints) < self._n:
            values = [
                tuple(new[i] if i in kind.joints else old for i, old in enumerate(before))
                for new, before in zip(values, self._values, strict=True)
            ]
        if not self.format.may_have_gaps:
            self._values = values
        if outcome == BEYOND and self._clip is not None:
            values[0] = self._clip.function(values[0])
        return self._state.stamp, values

    def _kind_of(self, message: JointState) -> _Kind:
        """Check names and lengths, and determine the kind of a message."""
        order = np.array(self.format.indices(message), np.int64)
        mimics = self.format.mimic_joints(message)
        followers = np.zeros(len(mimics), _FOLLOWER)
        for row, mimic in zip(followers, mimics, strict=True):
            row["index"], row["leader"], row["within"] = mimic.joint, mimic.leader, TOLERANCE
            for f, field in enumerate(self.format.fields):
                row["factor"][f], row["offset"][f] = mimic.factor_and_offset(field)
        lengths = [len(getattr(message, field)) for field in FIELDS]
        layout = layout_of(message.header.frame_id, message.name, lengths)
        joints = frozenset(np.flatnonzero(order >= 0).tolist())
        return _Kind(message.header.frame_id, joints, layout, order, followers)

    def _register(self, kind: _Kind, message: JointState) -> None:
        """Let C know a kind, in place of the oldest one."""
        oldest, layout = self._kind_count % _KINDS, kind.layout
        self._kinds[oldest : oldest + 1] = [kind]
        self._kind_count += 1
        shared = self._state.kinds[oldest]
        shared.size, shared.index = len(layout.mask), kind.order.ctypes.data
        shared.followers = kind.followers.ctypes.data
        shared.follower_count = len(kind.followers)
        shared.mask, shared.bits = (
            ctypes.cast(part, c_void_p).value for part in (layout.mask, layout.bits)
        )
        for f, field in enumerate(self.format.fields):
            present = len(getattr(message, field)) > 0
            shared.at[f] = layout.offsets[FIELDS.index(field)] if present else -1
