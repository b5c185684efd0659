# SPDX-License-Identifier: Apache-2.0
"""Detection of jumps of time or of the arm between two joint states, as after a reset."""

from __future__ import annotations

from collections.abc import Sequence
from operator import sub

from arm_dynamics.arrays import Array
from arm_dynamics.control.computed_torque import Measured

_FASTER = 2.0  # largest ratio of the speed of a displacement to the speeds before and after it


class Jumps:
    """Compares each state with the previous one.

    Args:
        names: The joints.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._before: tuple[int, list[float], list[float]] | None = None

    @property
    def last(self) -> tuple[list[float], list[float]]:
        """Positions and velocities of the last state; empty before the first state."""
        return ([], []) if self._before is None else self._before[1:]

    def note(self, stamp: int, q: Array, v: Array) -> None:
        """Set the last state: its stamp in [ns], and positions and velocities of shape (n,)."""
        self._before = (stamp, q.tolist(), v.tolist())

    def look(self, stamp: int, state: Measured, longest: float, farthest: float) -> str:
        """Describe a jump of time or of the arm since the last state; empty if there is none.

        Args:
            stamp: Time of the state in [ns].
            state: The state.
            longest: Longest time between two states in [s]; 0: any.
            farthest: Largest displacement of a joint beyond that by its velocity in [rad] or [m];
                0: any.
        """
        q, v = state.q.tolist(), state.v.tolist()  # a few numbers: faster than NumPy
        before, self._before = self._before, (stamp, q, v)
        if before is None:
            return ""
        gap = 1e-9 * (stamp - before[0])
        if gap < 0.0:
            return "time went backwards"
        if 0.0 < longest < gap:
            return f"time advanced by {gap:.3g} s between two states"
        if farthest and max(map(abs, map(sub, q, before[1]))) > farthest:
            return self._put(before, q, v, gap, farthest)
        return ""

    def _put(
        self,
        before: tuple[int, list[float], list[float]],
        q: list[float],
        v: list[float],
        gap: float,
        farthest: float,
    ) -> str:
        """The joint whose displacement its velocity does not explain, as text."""
        _, q0, v0 = before
        for joint, name in enumerate(self._names):
            moved = abs(q[joint] - q0[joint])
            if moved > farthest + _FASTER * gap * max(abs(v0[joint]), abs(v[joint])):
                return f"joint '{name}' moved by {moved:.3g} in {gap:.3g} s"
        return ""
