# SPDX-License-Identifier: Apache-2.0
"""What C needs in order to copy ticks into message buffers."""

from __future__ import annotations

from ctypes import Structure, addressof

from arm_dynamics.ros.joint_state import address
from arm_sim.recording.files.messages import TickWriter
from arm_sim.ros.node_library import RECORD
from arm_sim.simulation.simulated_arm import SimulatedArm


class _Tick(Structure):
    """``tick_t`` of record.h."""

    _fields_ = RECORD.fields("tick_t")


class TickCopy:
    """Memory for copies of ticks.

    Attributes:
        place: Address of ``tick_t``.
    """

    def __init__(self, writer: TickWriter, arm: SimulatedArm, tick: int, state: int) -> None:
        """Prepare; ``tick`` and ``state`` are the numbers of their channels."""
        self._tick = _Tick(
            raw=address(writer.raw), size=len(writer.raw), stamp=writer.stamp, hold=writer.hold,
            tick=tick, state=state,
        )  # fmt: skip
        numbers = arm.x, arm.acted, arm.notes
        for k, (place, array) in enumerate(zip(writer.places, numbers, strict=True)):
            self._tick.at[k], self._tick.sizes[k] = place, array.nbytes
            self._tick.numbers[k] = array.ctypes.data
        self.place, self._keep = addressof(self._tick), (writer, numbers)
