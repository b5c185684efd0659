# SPDX-License-Identifier: Apache-2.0
"""How late a torque may act: the margin of a loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics.arrays import Array

MARGIN = 2.0
"""Gain margin that is sensible: with so many times its gains a loop is still stable."""


def largest_delay(stiffness: ArrayLike, damping: ArrayLike, margin: float = MARGIN) -> Array:
    """Largest time by which a torque may act late without the arm swinging up.

    The error obeys ë(t) = -k e(t - T) - c ė(t - T). The gain of this loop is 1 at the frequency w,
    w⁴ = c² w² + k², where damping leads by the phase atan(c w/k) and the delay takes w T of it
    (Åström and Murray, Feedback Systems, 2021, section 10.3).

    Args:
        stiffness: k by inertia in [1/s²].
        damping: c by inertia in [1/s].
        margin: Factor of both.

    Returns:
        T in [s]; infinite without damping, which is then left to others.
    """
    k, c = margin * np.asarray(stiffness, float), margin * np.asarray(damping, float)
    w = np.sqrt(0.5 * (c**2 + np.sqrt(c**4 + 4.0 * k**2)))
    return np.where(c > 0.0, np.arctan2(c * w, k) / np.where(w > 0.0, w, 1.0), np.inf)
