# SPDX-License-Identifier: Apache-2.0
"""A change during a run: of tunable quantities, or of the state."""

from __future__ import annotations

from dataclasses import dataclass

from arm_dynamics.arrays import Array


@dataclass(frozen=True)
class Jump:
    """A change between two ticks.

    Attributes:
        row: Row of the recording with the time of the change and the state after it.
        x: State before, shape (nx,).
        p: Tunable quantities before, shape (np,).
        tunable: Names of those that were tunable before.
        substep: Next trial sub-step of the error control in [s]; see ``SimulatedArm.substep``.
    """

    row: int
    x: Array
    p: Array
    tunable: tuple[str, ...] = ()
    substep: float = 0.0
