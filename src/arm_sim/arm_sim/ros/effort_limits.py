# SPDX-License-Identifier: Apache-2.0
"""Commanded efforts beyond their limits are clipped, with a warning."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign

from arm_dynamics import ArmModel
from arm_dynamics.arrays import any_beyond
from arm_dynamics.ros.joint_state import Numbers
from arm_sim.inputs import clipping_message


class EffortLimits:
    """Limits of the efforts of a model's joints.

    Attributes:
        values: Largest magnitudes in [N m] or [N].
    """

    def __init__(self, model: ArmModel, warn: Callable[[str], object]) -> None:
        self._model, self._warn = model, warn
        self.values = model.command_limit.tolist()

    def clip(self, efforts: Numbers) -> Numbers:
        """The efforts, clipped, with a warning that names the first joint beyond its limit."""
        if not any_beyond(efforts, self.values):
            return efforts
        pairs = list(zip(efforts, self.values, strict=True))
        joint = next(i for i, (effort, limit) in enumerate(pairs) if abs(effort) > limit)
        self._warn(clipping_message(self._model, joint, efforts[joint]))
        return tuple(
            copysign(limit, effort) if abs(effort) > limit else effort for effort, limit in pairs
        )
