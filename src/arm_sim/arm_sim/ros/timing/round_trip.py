# SPDX-License-Identifier: Apache-2.0
"""The round trip of commands: from a state to its answer."""

from ctypes import Structure, addressof, byref

import numpy as np

from arm_sim.ros.node_library import TIMING, library
from arm_sim.ros.timing.histogram import Histogram

_SENT = TIMING.constants["SENT_STATES"]


class RoundTrip(Structure):
    """Time from a joint state to the command with its stamp.

    ``trip_t`` of timing.h; ``newest`` is the stamp of the state published last, in [ns].

    Attributes:
        histogram: Times of the answers so far.
    """

    _fields_ = TIMING.fields("trip_t")

    def __init__(self) -> None:
        self._stamps, self._times = np.full(_SENT, -1), np.zeros(_SENT, np.int64)
        super().__init__(stamps=self._stamps.ctypes.data, times=self._times.ctypes.data)
        self.reset()

    def reset(self) -> None:
        """Reset the counters."""
        self.histogram = Histogram()
        self.trips = addressof(self.histogram)

    def register_answer(self, stamp: int, arrival: int) -> bool:
        """Register when, in [ns] of the system, a command for a state arrived: the first counts.

        Returns:
            Whether that state is the newest.
        """
        return bool(library().trip_register_answer(byref(self), stamp, arrival))

    def awaits(self, stamp: int) -> bool:
        """Whether a state of ``stamp`` in [ns] was published lately and has no answer yet."""
        return stamp >= 0 and stamp in self._stamps

    def forget(self) -> None:
        """Forget the answer that acts: time stands still, or something else acts."""
        self.acting = 0

    def take_oldest(self) -> float:
        """The oldest age in [s] of the arm's time at which an answer acted since the last call."""
        oldest, self.oldest = self.oldest, 0
        return float(1e-9 * oldest)
