# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from arm_dynamics import ArmError

if TYPE_CHECKING:
    from arm_sim.integrators.selection import Choice
    from arm_sim.recording.recording import Recording
    from arm_sim.state import State


class SimulationDiverged(ArmError):
    """A step gave numbers that are not finite; the simulator keeps the last good state.

    Attributes:
        recording: The motion up to that state, if a run was recorded.
    """

    recording: Recording | None = None


def diverged(state: State, choice: Choice, hint: str = "") -> SimulationDiverged:
    """What is said when the tick after a state cannot be computed with a choice of method."""
    return SimulationDiverged(
        f"tick {state.step + 1} (t = {state.time:.6g} s) cannot be computed with "
        f"{choice.method.name}{choice.remark}; the state before it is kept: "
        f"largest |v| = {abs(state.v).max():.3g}{hint}"
    )
