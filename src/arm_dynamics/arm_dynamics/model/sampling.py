# SPDX-License-Identifier: Apache-2.0
"""Deterministic joint positions across an arm's range: for seeds and typical values."""

from __future__ import annotations

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.model.arm import ArmModel


def postures(model: ArmModel, count: int) -> Array:
    """Positions in [rad] or [m] within the joint limits, or one revolution without limits.

    Args:
        model: The arm.
        count: Number of positions.

    Returns:
        Shape (count, n).
    """
    low = np.where(np.isfinite(model.position_lower), model.position_lower, -np.pi)
    high = np.where(np.isfinite(model.position_upper), model.position_upper, np.pi)
    return np.random.default_rng(0).uniform(low, high, (count, model.n))
