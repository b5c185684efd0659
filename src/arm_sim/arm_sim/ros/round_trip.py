# SPDX-License-Identifier: Apache-2.0
"""How long partners take to answer a joint state."""

from __future__ import annotations

import time

from arm_sim.ros.histogram import Histogram, Percentiles

_REMEMBERED = 256  # states; an answer to an older one is not counted


class RoundTrip:
    """Measures the time from a joint state to the command that bears its stamp."""

    def __init__(self) -> None:
        """Start without any."""
        self._sent: dict[int, int] = {}
        self._histogram = Histogram()

    def forget(self) -> None:
        """Count afresh."""
        self._histogram = Histogram()

    def sent(self, stamp: int) -> None:
        """Note that the state of ``stamp`` in [ns] was published now."""
        self._sent[stamp] = time.time_ns()
        if len(self._sent) > _REMEMBERED:
            del self._sent[next(iter(self._sent))]

    def answered(self, stamp: int, arrival: int) -> None:
        """Note that a command for the state of ``stamp`` came; only the first one counts.

        Args:
            stamp: Time of the state in [ns].
            arrival: System time at which the command came in [ns].
        """
        sent = self._sent.pop(stamp, None)
        if sent is not None:
            self._histogram.add(arrival - sent)

    def percentiles(self) -> Percentiles:
        """Summarise the answers so far."""
        return self._histogram.percentiles()
