# SPDX-License-Identifier: Apache-2.0
"""Copying of ticks into message buffers, in a single C call if there is a compiler.

In a loop that wakes up a thousand times a second the processor's caches are cold, and the same
copy takes 50 µs in Python.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from ctypes import CDLL, Structure, addressof, c_char, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Protocol

from arm_dynamics.cdr import GIGA, TIME
from arm_dynamics.codegen.compiler import build, may_build
from arm_dynamics.exceptions import KernelError
from arm_sim.recording.files.messages import TickWriter
from arm_sim.ros.record.chunks import HEAD, Chunk
from arm_sim.simulator import Simulator

SOURCE = Path(__file__).with_name("native") / "record.c"
State = tuple[int, bytearray]
"""Stamp in [ns] of a published joint state, and its bytes."""
_log = logging.getLogger(__name__)


class TickCopy(Protocol):
    """Copies ticks, and the joint states published for them.

    Attributes:
        size: Bytes per tick.
    """

    size: int

    def __call__(self, chunk: Chunk, now: int, stamp: int, hold: int, state: State | None) -> None:
        """Copy the current tick into a chunk that has room for it.

        Args:
            chunk: The chunk.
            now: The time in [ns].
            stamp: Simulated time of the tick in [ns].
            hold: What held the arm, see ``Recording``.
            state: The joint state published since the last tick, which is stored before it.
        """


class _Tick(Structure):
    """``tick_t`` of record.c."""

    _fields_ = (
        ("raw", c_void_p), ("size", c_int64), ("stamp", c_int64), ("hold", c_int64),
        ("at", c_int64 * 3), ("numbers", c_void_p * 3), ("sizes", c_int64 * 3),
        ("tick", c_int64), ("state", c_int64),
    )  # fmt: skip


@cache
def native() -> CDLL | None:
    """The compiled function; None if it is not available."""
    if not may_build():
        return None
    try:
        library = build(SOURCE.read_text()).library
    except (KernelError, OSError) as error:
        _log.debug("ticks are copied in Python: %s", error)
        return None
    library.record.argtypes = [c_void_p] * 2 + [c_int64] * 3 + [c_void_p] + [c_int64] * 2
    library.record.restype = None
    return library


class CopyInPython:
    """See ``TickCopy``."""

    def __init__(self, writer: TickWriter, simulator: Simulator, tick: int, state: int) -> None:
        """Prepare; ``tick`` and ``state`` are the numbers of their channels."""
        self.size = HEAD + len(writer.raw)
        self._writer, self._channel, self._state = writer, tick, state
        self._parts = [
            (to, memoryview(numbers).cast("B"))
            for to, numbers in zip(
                (writer.state, writer.command, writer.notes),
                (simulator.x, simulator.acted, simulator.notes),
                strict=True,
            )
        ]

    def __call__(self, chunk: Chunk, now: int, stamp: int, hold: int, state: State | None) -> None:
        """See ``TickCopy``."""
        writer = self._writer
        TIME.pack_into(writer.raw, writer.stamp, *divmod(stamp, GIGA))
        for to, numbers in self._parts:
            to[:] = numbers
        writer.raw[writer.hold] = hold
        if state is not None:
            chunk.put(self._state, now, *state)
        chunk.put(self._channel, now, stamp, writer.raw)


class CopyInC:
    """See ``TickCopy``.

    Attributes:
        place: Address of ``tick_t``, for other compiled code.
    """

    def __init__(
        self, record: Callable[..., None], writer: TickWriter, simulator: Simulator,
        tick: int, state: int,
    ) -> None:  # fmt: skip
        """Prepare; ``tick`` and ``state`` are the numbers of their channels."""
        self.size, self._record = HEAD + len(writer.raw), record
        self._tick = _Tick(
            raw=_address(writer.raw), size=len(writer.raw), stamp=writer.stamp, hold=writer.hold,
            tick=tick, state=state,
        )  # fmt: skip
        numbers = simulator.x, simulator.acted, simulator.notes
        for k, (place, array) in enumerate(zip(writer.places, numbers, strict=True)):
            self._tick.at[k], self._tick.sizes[k] = place, array.nbytes
            self._tick.numbers[k] = array.ctypes.data
        self.place, self._keep = c_void_p(addressof(self._tick)), (writer, numbers)
        self._message, self._address = bytearray(), 0

    def __call__(self, chunk: Chunk, now: int, stamp: int, hold: int, state: State | None) -> None:
        """See ``TickCopy``."""
        if state is None:
            self._record(chunk.address, self.place, now, stamp, hold, None, 0, 0)
            return
        state_stamp, message = state
        if message is not self._message:
            self._message, self._address = message, _address(message)
        size = len(message)
        self._record(chunk.address, self.place, now, stamp, hold, self._address, size, state_stamp)


def tick_copy(writer: TickWriter, simulator: Simulator, tick: int, state: int) -> TickCopy:
    """The fastest available copy; ``tick`` and ``state`` are the numbers of their channels."""
    if (compiled := native()) is None:
        return CopyInPython(writer, simulator, tick, state)
    return CopyInC(compiled.record, writer, simulator, tick, state)


def _address(buffer: bytearray) -> int:
    """Address of the bytes of a buffer, whose size is fixed from now on."""
    return addressof(c_char.from_buffer(buffer))
