# SPDX-License-Identifier: Apache-2.0
"""Order of the ticks and changes of a file, as rows of a recording."""

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


class Timeline:
    """Changes and ticks in the order of their file, in a time that continues across resets.

    A tick ends one step after its predecessor, and a change is at the same time. A change that is
    earlier is a reset; everything else is a gap. Ticks, and changes after gaps, begin a row.

    Args:
        places: Places in the file, of changes, then of ticks.
        steps: Their steps in the simulation's own time.
        changes: Number of changes.

    Attributes:
        order: Indices in order of the file.
        is_tick: Whether each in this order is a tick, or a change.
        step: Step of each in the continuing time.
        row: Row of each.
        first: The first one of each row.
        last: The last one of each row.
        gaps: Rows before which ticks are missing.
    """

    def __init__(self, places: Indices, steps: Indices, changes: int) -> None:
        self.order = np.argsort(places)
        self.is_tick = self.order >= changes
        self._places, self._steps = places[self.order], steps[self.order]
        ahead = np.diff(self._steps, prepend=self._steps[0])
        self.step = self._steps[0] + np.cumsum(np.maximum(ahead, self.is_tick))
        begins = self.is_tick | (ahead > 0)
        begins[0] = True
        self.row, self.first = np.cumsum(begins) - 1, np.flatnonzero(begins)
        self.last = np.append(self.first[1:], len(begins)) - 1
        self.gaps = tuple(self.row[begins & (ahead != self.is_tick)].tolist())

    def following_ticks(self) -> tuple[Indices, NDArray[np.bool_]]:
        """The tick from each row to the next: its number from 1, and whether there is one.

        Where there is none, the number is that of the last tick before; 0 without one.
        """
        following = np.append(self.first[1:], len(self.order) - 1)
        return np.cumsum(self.is_tick)[following], np.append(self.is_tick[self.first[1:]], False)

    def offset_at(self, place: int) -> int:
        """Steps by which the continuing time is ahead of the simulation's at a place in a file."""
        at = max(int(np.searchsorted(self._places, place, side="right")) - 1, 0)
        return int(self.step[at] - self._steps[at])
