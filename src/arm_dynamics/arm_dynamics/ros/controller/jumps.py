# SPDX-License-Identifier: Apache-2.0
"""Detection of jumps of time or of the arm between two joint states, as after a reset."""

from collections.abc import Sequence
from ctypes import addressof, byref

import numpy as np

from arm_dynamics.control.controller import Measured
from arm_dynamics.ros.controller.controller_library import HEADER, library

_STEADY, _BACKWARDS, _PAUSED, _MOVED = (
    HEADER.constants[name] for name in ("STEADY", "BACKWARDS", "PAUSED", "MOVED")
)


class Jumps:
    """Compares each state of the joints ``names`` with the previous one.

    Attributes:
        address: Address of ``state_t``, which C compares and updates as well.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._q, self._v = np.zeros((2, len(names)))
        self._previous = HEADER.structure("state_t")(q=self._q.ctypes.data, v=self._v.ctypes.data)
        self.address = addressof(self._previous)

    @property
    def stamp(self) -> int:
        """Stamp of the last state in [ns]."""
        return int(self._previous.stamp)

    def take_longest(self) -> float:
        """The longest time between two states since the last call in [s], jumps apart."""
        longest, self._previous.longest = self._previous.longest, 0
        return float(1e-9 * longest)

    def detect(self, stamp: int, state: Measured, gap_limit: float, jump_limit: float) -> str:
        """Describe a jump of time or of the arm since the last state; empty if there is none.

        A gap up to ``gap_limit`` in [s] is no jump, nor is a displacement of a joint that exceeds
        that by its velocity by up to ``jump_limit`` in [rad] or [m]; 0: any. ``stamp`` is the
        state's time in [ns].
        """
        q, v = np.ascontiguousarray(state.q), np.ascontiguousarray(state.v)
        compared = byref(self._previous), len(q), stamp, q.ctypes.data, v.ctypes.data
        kind = library().find_jump(*compared, gap_limit, jump_limit)
        jump, gap = "", 1e-9 * (stamp - self.stamp)
        if kind == _BACKWARDS:
            jump = "time went backwards"
        elif kind == _PAUSED:
            jump = f"time advanced by {gap:.3g} s between two states"
        elif kind != _STEADY:
            joint = kind - _MOVED
            moved = abs(state.q[joint] - self._q[joint])
            jump = f"joint '{self._names[joint]}' moved by {moved:.3g} in {gap:.3g} s"
        if kind != _STEADY:
            self._previous.valid = 0  # so C measures no time between states across a jump
        library().note_state(*compared)
        return jump
