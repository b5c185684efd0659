# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulator."""

from __future__ import annotations

from typing import Any

from arm_dynamics import ArmError, InvalidInput


class SimulationDiverged(ArmError):
    """A step gave numbers that are not finite; the simulator keeps the last good state.

    Attributes:
        recording: The ``Recording`` up to that state, if a run was recorded.
    """

    recording: Any = None


class NotDifferentiable(InvalidInput):
    """A tick has no derivative at a state: the least change of it would change the events.

    A state on the edge between two modes, events at the same instant or at the very beginning or
    end of the tick, a contact that is grazed.
    """


class ViewError(ArmError):
    """Something cannot be shown: a library, a browser or a port is missing, or a file is bad."""
