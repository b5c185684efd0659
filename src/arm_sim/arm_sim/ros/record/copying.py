# SPDX-License-Identifier: Apache-2.0
"""Copying of ticks into message buffers, in a single call of C.

In a loop that wakes up a thousand times a second the processor's caches are cold, and the same
copy takes 50 µs in Python.
"""

from __future__ import annotations

from ctypes import Structure, addressof, c_void_p

from arm_dynamics.ros.joint_state import address
from arm_sim.recording.files.messages import TickWriter
from arm_sim.ros.node_library import RECORD, library
from arm_sim.ros.record.chunks import HEAD, Chunk
from arm_sim.simulation.simulated_arm import SimulatedArm

State = tuple[int, bytearray]
"""Stamp in [ns] of a published joint state, and its bytes."""


class _Tick(Structure):
    """``tick_t`` of record.h."""

    _fields_ = RECORD.fields("tick_t")


class TickCopy:
    """Copies ticks, and the joint states published for them.

    Attributes:
        size: Bytes per tick.
        place: Address of ``tick_t``, for other compiled code.
    """

    def __init__(self, writer: TickWriter, arm: SimulatedArm, tick: int, state: int) -> None:
        """Prepare; ``tick`` and ``state`` are the numbers of their channels."""
        self.size, self._record = HEAD + len(writer.raw), library().record
        self._tick = _Tick(
            raw=address(writer.raw), size=len(writer.raw), stamp=writer.stamp, hold=writer.hold,
            tick=tick, state=state,
        )  # fmt: skip
        numbers = arm.x, arm.acted, arm.notes
        for k, (place, array) in enumerate(zip(writer.places, numbers, strict=True)):
            self._tick.at[k], self._tick.sizes[k] = place, array.nbytes
            self._tick.numbers[k] = array.ctypes.data
        self.place, self._keep = c_void_p(addressof(self._tick)), (writer, numbers)
        self._message, self._address = bytearray(), 0

    def __call__(self, chunk: Chunk, now: int, stamp: int, hold: int, state: State | None) -> None:
        """Copy the current tick into a chunk that has room for it.

        Args:
            chunk: The chunk.
            now: The time in [ns].
            stamp: Simulated time of the tick in [ns].
            hold: What held the arm, see ``Recording``.
            state: The joint state published since the last tick, which is stored before it.
        """
        if state is None:
            self._record(chunk.address, self.place, now, stamp, hold, None, 0, 0)
            return
        state_stamp, message = state
        if message is not self._message:
            self._message, self._address = message, address(message)
        size = len(message)
        self._record(chunk.address, self.place, now, stamp, hold, self._address, size, state_stamp)
