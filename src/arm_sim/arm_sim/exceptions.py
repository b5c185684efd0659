# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulator."""

from __future__ import annotations

from typing import Any

from arm_dynamics import ArmError


class SimulationDiverged(ArmError):
    """A step gave numbers that are not finite; the simulator keeps the last good state.

    Attributes:
        recording: The ``Recording`` up to that state, if a run was recorded.
    """

    recording: Any = None
