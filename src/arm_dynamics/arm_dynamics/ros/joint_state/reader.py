# SPDX-License-Identifier: Apache-2.0
"""Reads numbers from serialized JointStates, in C.

The first message of a kind is parsed by ROS's deserializer: its names and lengths are checked, and
its layout is passed to C, which reads it and all that follow. Why a message is refused is
determined here.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from ctypes import c_void_p
from functools import partial
from struct import Struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from arm_dynamics.codegen.addresses import address
from arm_dynamics.exceptions import InvalidInput, known_names
from arm_dynamics.ros.joint_state.joint_state_library import HEADER, library
from arm_dynamics.ros.joint_state.serialization import FIELDS, Layout, layout_of, parsed
from arm_dynamics.scene.urdf.joint_names import AGREES, Follower, JointNames

Numbers = tuple[float, ...]
Read = tuple[int, list[Numbers]]  # stamp in [ns], and n numbers for each of the fields

_OUTCOMES = ("NONE", "KNOWN", "BEYOND", "FAILED")
NONE, KNOWN, BEYOND, FAILED = (HEADER.constants[name] for name in _OUTCOMES)
_KINDS = HEADER.constants["KINDS"]
_FOLLOWER = np.dtype(HEADER.structure("follower_t"))


class _Kind(NamedTuple):
    """A kind of message: its source, the joints that it names, and what C reads it by."""

    source: str
    joints: frozenset[int]
    layout: Layout
    order: NDArray[np.int64]
    followers: NDArray[np.void]


class JointStateReader:
    """Reads numbers in a given order of joints from serialized JointStates."""

    def __init__(
        self,
        names: Sequence[str],
        fields: Sequence[str],
        *,
        partial: bool,
        extra: bool,
        admit: Callable[[str, frozenset[int]], None] = lambda source, joints: None,
        limit: Sequence[float] = (),
        beyond: Callable[[Numbers], Numbers] = lambda numbers: numbers,
        gaps: bool = False,
        other: JointStateReader | None = None,
    ) -> None:
        """Configure the reader.

        Args:
            names: Joints, in the order of the numbers read. Those of an arm know its mimic joints,
                which messages may name, too, with numbers that agree with their leaders'.
            fields: Those of position, velocity and effort that are required.
            partial: Whether joints may be absent; they keep their last values, initially zero.
            extra: Whether joints that are not in ``names`` are ignored.
            admit: Called with the frame_id of each message and the indices of the joints that it
                names, before its numbers are used; may raise InvalidInput.
            limit: Largest magnitudes of the numbers of the first field, n of them; or none.
            beyond: Called with the numbers of the first field if one of them is larger; returns
                the numbers to use instead.
            gaps: Whether numbers, or whole fields, may be missing; they are read as NaN, like
                absent joints.
            other: Reads messages that have a position or velocity instead of this reader.
        """
        self._arm = names if isinstance(names, JointNames) else JointNames(names)
        self._names, self._fields = list(names), list(fields)
        self._partial, self._extra, self._admit = partial, extra, admit
        self._beyond, self._gaps, self._other = beyond, gaps, other
        absent = math.nan if gaps else 0.0
        self._values: list[Numbers] = [(absent,) * len(self._names) for _ in fields]
        self._bind(np.array(limit, float))

    def _bind(self, limit: NDArray[np.float64]) -> None:
        """Prepare the memory that C uses."""
        n, count = len(self._names), len(self._fields)
        self._found, self._limit = bytearray(24 + 8 * n * count), limit
        self._unpack = Struct(f"=qqq{n * count}d").unpack_from
        self._numbers = [slice(3 + n * k, 3 + n * (k + 1)) for k in range(count)]
        self._state = HEADER.structure("joint_state_t")(
            fields=count, joints=n, found=address(self._found),
            limit=limit.ctypes.data if limit.size else None, gaps=self._gaps,
        )  # fmt: skip
        self._kinds, self._learned = list[_Kind](), 0
        self._memory = c_void_p(None)
        self._native, self._place = library(), c_void_p(ctypes.addressof(self._state))
        self._read = partial(self._native.joint_state_read, self._place)

    def read(self, raw: bytes) -> Read:
        """The stamp in [ns] of a serialized JointState, and n numbers for each of the fields.

        Raises:
            InvalidInput: If joints or numbers are missing, unknown, repeated or not finite.
        """
        if (outcome := self._read(raw, len(raw))) <= BEYOND:
            return self._accepted(outcome)
        return self._learn(raw)

    def open(self, subscription: int) -> None:
        """Prepare to receive from an ``rcl_subscription_t``; ``close`` before it is destroyed."""
        self._memory = c_void_p(self._native.joint_state_source(subscription))
        self.take = partial(self._native.joint_state_take, self._memory, self._place)

    def close(self) -> None:
        """Free the memory for messages."""
        self.take = partial(int, NONE)
        if self._memory:
            self._native.joint_state_source_free(self._memory)
            self._memory = c_void_p(None)

    @property
    def places(self) -> tuple[int, int]:
        """Addresses of ``source_t`` and ``joint_state_t``, for other compiled code."""
        return self._memory.value or 0, ctypes.addressof(self._state)

    def whole_from(self, source: str) -> list[bool]:
        """The known kinds that come from a source and name all joints."""
        n = len(self._names)
        return [kind.source == source and len(kind.joints) == n for kind in self._kinds]

    def keep(self, numbers: Numbers) -> None:
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
        return int(self._unpack(self._found)[1])

    def _accepted(self, outcome: int) -> Read:
        """The values that C has read with that outcome, if admitted."""
        kind = self._kinds[self._unpack(self._found)[2]]
        self._admit(kind.source, kind.joints)
        return self._values_of(kind, outcome)

    def _values_of(self, kind: _Kind, outcome: int) -> Read:
        found = self._unpack(self._found)
        values: list[Numbers] = [found[place] for place in self._numbers]
        if len(kind.joints) < len(self._names):
            values = [
                tuple(new[i] if i in kind.joints else old for i, old in enumerate(before))
                for new, before in zip(values, self._values, strict=True)
            ]
        if not self._gaps:
            self._values = values
        if outcome == BEYOND:
            values[0] = self._beyond(values[0])
        return found[0], values

    def _learn(self, raw: bytes) -> Read:
        """Read a message of a kind that C does not know yet, or that it does not accept."""
        other = self._other
        if other is not None and (found := other._read(raw, len(raw))) <= BEYOND:
            return other._accepted(found)
        message = parsed(raw)
        if other is not None and (message.position or message.velocity):
            return other._introduced(message)
        return self._introduced(message)

    def _introduced(self, message: JointState) -> Read:
        """Pass the kind of a message to C, and read it, in this machine's byte order."""
        kind = self._kind_of(message)
        if all(kind.layout != known.layout for known in self._kinds):
            self._register(kind, message)  # admitted or not: a rival may send as often as a leader
        self._admit(kind.source, kind.joints)
        raw = bytes(serialize_message(message))
        if (outcome := self._read(raw, len(raw))) <= BEYOND:
            return self._values_of(kind, outcome)
        raise InvalidInput(self._what_is_wrong(message))

    def _kind_of(self, message: JointState) -> _Kind:
        """Check names and lengths, and determine the kind of a message."""
        order = np.array(self._places(message), np.int64)
        followers = self._followers(message)
        laws = np.zeros(len(followers), _FOLLOWER)
        for law, follower in zip(laws, followers, strict=True):
            law["place"], law["leader"], law["within"] = follower.place, follower.leader, AGREES
            for f, field in enumerate(self._fields):
                law["factor"][f], law["offset"][f] = follower.law(field)
        lengths = [len(getattr(message, field)) for field in FIELDS]
        layout = layout_of(message.header.frame_id, message.name, lengths)
        joints = frozenset(np.flatnonzero(order >= 0).tolist())
        return _Kind(message.header.frame_id, joints, layout, order, laws)

    def _followers(self, message: JointState) -> list[Follower]:
        """Mimic joints whose numbers are checked: none where joints of others may be named."""
        return [] if self._extra else self._arm.followers(list(message.name))

    def _register(self, kind: _Kind, message: JointState) -> None:
        """Let C know a kind, in place of the oldest one."""
        oldest, layout = self._learned % _KINDS, kind.layout
        self._kinds[oldest : oldest + 1] = [kind]
        self._learned += 1
        shared = self._state.kinds[oldest]
        shared.size, shared.place = len(layout.fixed), kind.order.ctypes.data
        shared.follows, shared.followers = kind.followers.ctypes.data, len(kind.followers)
        shared.fixed, shared.expected = (
            ctypes.cast(part, c_void_p).value for part in (layout.fixed, layout.expected)
        )
        shared.at[: len(self._fields)] = [
            layout.places[FIELDS.index(f)] if getattr(message, f) else -1 for f in self._fields
        ]

    def _what_is_wrong(self, message: JointState) -> str:
        """The number for which C does not accept a message."""
        for field in self._fields:
            numbers = dict(zip(message.name, getattr(message, field), strict=False))
            for joint in self._names:
                x = numbers.get(joint, 0.0)
                if not (math.isfinite(x) or (self._gaps and math.isnan(x))):
                    return f"{field} of joint '{joint}' is {x}; allowed: finite numbers"
            for follower in self._followers(message):
                if numbers:
                    follower.check(field, field, getattr(message, field))
        return f"the JointState of '{message.header.frame_id}' cannot be read"

    def _places(self, message: JointState) -> list[int]:
        """Check names and lengths; return each joint's index in the message, -1 if absent."""
        names = list(message.name)
        if len(set(names)) != len(names):
            raise InvalidInput(f"joints {names} are not all different; allowed: each joint once")
        for field in self._fields:
            length = len(getattr(message, field))
            if length != len(names) and not (self._gaps and length == 0):
                raise InvalidInput(
                    f"{field} has {length} numbers for {len(names)} joints; "
                    "allowed: one for each name"
                )
        here = [name for name in names if name in self._names]
        missing = [name for name in self._names if name not in names]
        if not self._extra:
            self._arm.refuse(names, "unknown joints")
        if missing and (not here or not self._partial):
            raise InvalidInput(f"joints {known_names(missing)} are missing")
        return [names.index(name) if name in names else -1 for name in self._names]
