# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulator."""

from typing import Any

from arm_dynamics import ArmError, InvalidInput


class SimulationDiverged(ArmError):
    """A step produced numbers that are not finite; the simulator keeps the last good state.

    Attributes:
        recording: The ``Recording`` up to that state, if a run was recorded.
    """

    recording: Any = None


class NotDifferentiable(InvalidInput):
    """A tick has no derivative at a state, because small changes of it act differently.

    Examples are a state on the boundary between two modes, events at the same instant or exactly
    at the beginning or end of the tick, a contact that is grazed, a joint held between its sliding
    and its static level, and a command exactly at its limit.
    """


class NoRecording(ArmError, FileNotFoundError):
    """There is no file or folder where a recording is to be read, or no folder to write it to."""


class ViewError(ArmError):
    """Something cannot be shown: a library, browser or port is missing, or a file is invalid."""
