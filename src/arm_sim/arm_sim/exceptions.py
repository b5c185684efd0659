# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from arm_dynamics import ArmError

if TYPE_CHECKING:
    from arm_sim.recording import Recording


class SimulationDiverged(ArmError):
    """A step gave numbers that are not finite; the simulator keeps the last good state.

    Attributes:
        recording: The motion up to that state, if a run was recorded.
    """

    recording: Recording | None = None
