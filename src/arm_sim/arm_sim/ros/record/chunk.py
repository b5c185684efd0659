# SPDX-License-Identifier: Apache-2.0
"""A buffer of messages, filled in C."""

from collections.abc import Iterator
from ctypes import Structure, addressof, c_void_p
from struct import Struct

import numpy as np

from arm_dynamics.codegen.addresses import address
from arm_sim.ros.node_library import RECORD, library

PERIOD = 0.5  # [s] after which a chunk is written, even if not full
PERIOD_NS = round(1e9 * PERIOD)
MESSAGE = Struct("<BQHIQQ")  # opcode, length, channel, sequence, log and publish time in [ns]
HEAD = MESSAGE.size  # bytes of a message's head


class Chunk(Structure):
    """A buffer for messages: ``chunk_t`` of record.h, where the fields are explained."""

    _fields_ = RECORD.fields("chunk_t")

    def __init__(self, size: int) -> None:
        """Allocate so many bytes, and offsets of as many messages as fit."""
        self._memory, self._starts = bytearray(size), np.zeros(size // HEAD, np.int64)
        super().__init__(
            raw=address(self._memory), places=self._starts.ctypes.data, size=size,
            oldest=PERIOD_NS,
        )  # fmt: skip
        self.address = c_void_p(addressof(self))

    def fits(self, now: int, size: int) -> bool:
        """Whether there is room for so many bytes, and it is not too old, at the time in [ns]."""
        return bool(library().chunk_has_room(self.address, now, size))

    def put(self, channel: int, log: int, publish: int, data: bytes | bytearray) -> None:
        """Copy a message that fits, with its times in [ns]."""
        place = data if isinstance(data, bytes) else address(data)
        library().chunk_put(self.address, channel, log, publish, place, len(data))

    def messages(self) -> Iterator[tuple[int, int, bytes, int]]:
        """Channel, log time, data and publish time of each message."""
        for start in self._starts[: self.count].tolist():
            _, length, channel, _, log, publish = MESSAGE.unpack_from(self._memory, start)
            data = self._memory[start + HEAD : start + 9 + length]  # opcode and length take 9
            yield channel, log, bytes(data), publish

    def clear(self) -> None:
        """Discard its contents."""
        self.at = self.count = self.since = 0
